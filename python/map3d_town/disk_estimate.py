"""Estimates the disk space of a town from a sample, and checks the free space."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from io import StringIO
from typing import TypeVar

import numpy as np

from map3d_town.layout.town_plan import BuildingPlan
from map3d_town.models.building_attributes import describe_building
from map3d_town.output_folder import TownFolder
from map3d_town.production_jobs import atlas_groups, build_atlas_group, obj_name, orthophoto_size
from map3d_town.textures.texture_atlas import draw_atlas, encode_jpeg
from map3d_town.town_errors import TownError
from map3d_town.town_spec import BYTES_PER_DEM_PX, BYTES_PER_TREE, SHARED_BYTES, TownEstimate
from map3d_town.writers.citygml_writer import BuildingWriter, SharedAppearance, write_foot
from map3d_town.writers.ground_rasters import OrthophotoRenderer
from map3d_town.writers.jpeg_geotiff import TILE_PX, encoded_tile_bytes
from map3d_town.writers.obj_writer import obj_text

SPARE_BYTES = 64 << 20
GROUPS, TILES = 64, 64
"""Number of atlases and orthophoto tiles in the sample."""
PLENTY = 4
T = TypeVar("T")


def check_disk_space(town: TownFolder) -> None:
    """Raises TownError if the disk cannot hold the town. Takes a sample only if less than four times the rough estimate is free."""
    existing = next(p for p in [town.root, *town.root.absolute().parents] if p.exists())
    free, completed = shutil.disk_usage(existing).free, sum(town.completed.values())
    if town.spec.estimate().disk_bytes * PLENTY + SPARE_BYTES < free:
        return
    needed = max(0, estimate_from_sample(town).disk_bytes - completed)
    if needed + SPARE_BYTES > free:
        advice = "use fewer or smaller textures, or a coarser orthophoto"
        raise TownError(f"{town.root}: the town needs about {needed >> 20} MiB, but only {free >> 20} MiB are free; {advice}")


def estimate_from_sample(town: TownFolder) -> TownEstimate:
    """Estimates within 15 % from a sample of atlases, buildings and orthophoto tiles generated in memory."""
    rough, spec = town.spec.estimate(), town.spec
    groups = [group for file in range(spec.files) for group in atlas_groups(town.plan, spec, file)]
    size = SHARED_BYTES + len(groups) * float(np.mean([_atlas_group_bytes(town, group) for group in sample_evenly(groups, GROUPS)]))
    if "citygml" in spec.formats and spec.trees:
        size += BYTES_PER_TREE * len(town.plan.trees)
    px_m, side_px = orthophoto_size(spec, town.plan)
    if spec.terrain:
        size += (2 * town.plan.radius_m / spec.dem_pixel_m(2 * town.plan.radius_m)) ** 2 * BYTES_PER_DEM_PX
        size += _orthophoto_bytes(town, px_m, side_px)
    return replace(rough, disk_bytes=int(size), ortho_side_px=side_px if spec.terrain else 0, extent_m=2 * town.plan.radius_m)


def sample_evenly(items: Sequence[T], count: int) -> list[T]:
    """Returns at most `count` evenly spaced items."""
    count = min(count, len(items))
    return [items[len(items) * (2 * i + 1) // (2 * count)] for i in range(count)]


def _atlas_group_bytes(town: TownFolder, buildings: list[BuildingPlan]) -> int:
    """Size in all formats of buildings that share an atlas, with the atlas."""
    spec = town.spec
    models, atlas = build_atlas_group(town, buildings)
    size = len(encode_jpeg(draw_atlas(atlas, buildings[0].number))) * len(spec.formats) if atlas is not None else 0
    if "citygml" in spec.formats:
        text, shared = StringIO(), SharedAppearance()
        writer = BuildingWriter(text, town.crs_offset, shared)
        for model in models:
            writer.write(model, atlas, "textures/a000_00000.jpg", describe_building(model, spec))
        write_foot(text, shared)
        size += text.tell()
    if "obj" in spec.formats:
        size += sum(len(obj_text(model, obj_name(model.plan), atlas, "a000_00000", town.crs_offset)) for model in models)
    return size


def _orthophoto_bytes(town: TownFolder, px_m: float, side_px: int) -> float:
    """Size of the orthophoto, from the mean of evenly spaced tiles."""
    renderer, across = OrthophotoRenderer(town.plan, px_m), -(-side_px // TILE_PX)
    rows = sample_evenly(range(across), int(TILES**0.5))
    sizes = [encoded_tile_bytes(renderer.render(x * TILE_PX, y * TILE_PX, TILE_PX, TILE_PX)) for y in rows for x in rows]
    return float(np.mean(sizes)) * (side_px / TILE_PX) ** 2
