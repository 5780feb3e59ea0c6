"""Builds the 3D model of a planned building."""

import numpy as np

from map3d_town.layout.ground_heights import Ground
from map3d_town.layout.town_plan import BuildingPlan
from map3d_town.models.building_installations import add_installations
from map3d_town.models.building_model import BuildingModel
from map3d_town.models.facade_design import TexturedFacadeDesign, UntexturedFacadeDesign
from map3d_town.models.part_shell import build_shell
from map3d_town.seeds import rng

DEEP_KINDS = frozenset({"house", "villa", "gruender", "row", "townhall"})


def build_model(building: BuildingPlan, seed: int, ground: Ground, deep_share: float) -> BuildingModel:
    """Returns the model of a building. Storeys count from the mean ground height; walls begin below the lowest."""
    source = rng(seed, "lot", building.number)
    outline = np.concatenate([part.footprint for part in building.parts])
    heights = ground.height(outline[:, 0], outline[:, 1])
    ground_z, base_z = float(heights.mean()), float(heights.min()) - 0.4
    deep = building.kind in DEEP_KINDS and source.random() < deep_share
    bodies = []
    for number, part in enumerate(building.parts):
        part_base = base_z if part.lift_m is None else ground_z + part.lift_m
        if building.kind == "shed":
            bodies.append(build_shell(part, part_base, ground_z, UntexturedFacadeDesign()))
            continue
        style = rng(seed, "style", building.number, part.facade_kind, part.cover)
        design = TexturedFacadeDesign(part.facade_kind, part.cover, part.storeys, part.eave_m, style, deep)
        body = build_shell(part, part_base, ground_z, design)
        add_installations(body, part, building, number, design, ground_z, source)
        bodies.append(body)
    return BuildingModel(building, tuple(bodies), ground_z, deep)
