"""Builds a lot: the bodies of its parts with dormers, chimneys, columns and balconies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from map3d_town.facade import PlainDress, TownDress
from map3d_town.fittings import add_fittings
from map3d_town.ground import Ground
from map3d_town.model import Body, Lot, Part
from map3d_town.seeds import rng
from map3d_town.shell import build_shell

Points = NDArray[np.float64]
DEEP_KINDS = frozenset({"house", "villa", "gruender", "row", "townhall"})


@dataclass(frozen=True)
class Built:
    """A lot with its geometry; `deep` when its openings are modelled."""

    lot: Lot
    bodies: tuple[Body, ...]
    ground_z: float
    deep: bool


def footprint(part: Part) -> Points:
    """(n, 2) the outer ring of a part, counter-clockwise."""
    return part.front if part.closed else np.concatenate([part.front, part.back[::-1]])


def build(lot: Lot, seed: int, ground: Ground, deep_share: float) -> Built:
    """The bodies of a lot on its ground: storeys count from the mean height under it, walls begin below the lowest."""
    source = rng(seed, "lot", lot.number)
    outline = np.concatenate([footprint(part) for part in lot.parts])
    heights = ground.height(outline[:, 0], outline[:, 1])
    ground_z, base_z = float(heights.mean()), float(heights.min()) - 0.4
    deep = lot.kind in DEEP_KINDS and source.random() < deep_share
    bodies = []
    for number, part in enumerate(lot.parts):
        part_base = base_z if part.lift_m is None else ground_z + part.lift_m
        if lot.kind == "shed":
            bodies.append(build_shell(part, part_base, ground_z, PlainDress()))
            continue
        style = rng(seed, "style", lot.number, part.look, part.cover)
        dress = TownDress(part.look, part.cover, part.storeys, part.eave_m, style, deep)
        body = build_shell(part, part_base, ground_z, dress)
        add_fittings(body, part, lot, number, dress, ground_z, source)
        bodies.append(body)
    return Built(lot, tuple(bodies), ground_z, deep)
