"""How much disk a town takes, measured on a sample of it; and whether there is so much."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from io import StringIO
from typing import TypeVar

import numpy as np

from map3d_town import citygml, obj
from map3d_town.atlas import atlas_picture, jpeg
from map3d_town.describe import describe
from map3d_town.errors import TownError
from map3d_town.house import build
from map3d_town.jpeg_tiff import TILE_PX, tile_bytes
from map3d_town.model import Lot
from map3d_town.raster import Painter
from map3d_town.site import Site
from map3d_town.spec import BYTES_PER_DEM_PX, BYTES_PER_TREE, SHARED_BYTES, Estimate
from map3d_town.work import atlas_of, groups, obj_name, ortho_size

SPARE_BYTES = 64 << 20
GROUPS, TILES = 64, 64
PLENTY = 4
T = TypeVar("T")


def check_room(site: Site) -> None:
    """Refuses to begin what the disk cannot hold: by the rule of thumb when there is plenty of room, by a sample when it may be tight."""
    home = next(p for p in [site.out, *site.out.absolute().parents] if p.exists())
    free, there = shutil.disk_usage(home).free, sum(site.done.values())
    if site.spec.estimate().disk_bytes * PLENTY + SPARE_BYTES < free:
        return
    needed = max(0, measured(site).disk_bytes - there)
    if needed + SPARE_BYTES > free:
        advice = "ask for fewer or smaller textures, or a coarser orthophoto"
        raise TownError(f"{site.out}: the town needs about {needed >> 20} MiB, {free >> 20} MiB are free; {advice}")


def measured(site: Site) -> Estimate:
    """Within 15 %, from some of the atlases, buildings and orthophoto tiles, made in memory."""
    rough, spec = site.spec.estimate(), site.spec
    every = [lots for file in range(spec.files) for lots in groups(site, file)]
    size = SHARED_BYTES + len(every) * float(np.mean([_group_bytes(site, lots) for lots in spread(every, GROUPS)]))
    if "citygml" in spec.formats and spec.trees:
        size += BYTES_PER_TREE * len(site.plan.trees)
    px_m, side_px = ortho_size(site)
    if spec.terrain:
        size += (2 * site.plan.radius_m / spec.dem_pixel_m(2 * site.plan.radius_m)) ** 2 * BYTES_PER_DEM_PX
        size += _ortho_bytes(site, px_m, side_px)
    return replace(rough, disk_bytes=int(size), ortho_side_px=side_px if spec.terrain else 0, extent_m=2 * site.plan.radius_m)


def spread(every: Sequence[T], most: int) -> list[T]:
    """At most so many, evenly spaced, each from the middle of its share."""
    count = min(most, len(every))
    return [every[len(every) * (2 * i + 1) // (2 * count)] for i in range(count)]


def _group_bytes(site: Site, lots: list[Lot]) -> int:
    """What the buildings of an atlas and their pictures take in all formats."""
    spec = site.spec
    built = [build(lot, spec.seed, site.ground, spec.deep_share) for lot in lots]
    atlas = atlas_of(built, spec.atlas_px)
    size = len(jpeg(atlas_picture(atlas, lots[0].number))) * len(spec.formats) if atlas is not None else 0
    if "citygml" in spec.formats:
        text, looks = StringIO(), citygml.Looks()
        writer = citygml.BuildingWriter(text, site.shift, looks)
        for each in built:
            writer.write(each, atlas, "textures/a000_00000.jpg", describe(each, spec))
        citygml.end(text, looks)
        size += text.tell()
    if "obj" in spec.formats:
        size += sum(len(obj.obj_text(each, obj_name(each.lot), atlas, "a000_00000", site.shift)) for each in built)
    return size


def _ortho_bytes(site: Site, px_m: float, side_px: int) -> float:
    """From tiles on a lattice all over the town."""
    painter, across = Painter(site.plan, px_m), -(-side_px // TILE_PX)
    rows = spread(range(across), int(TILES**0.5))
    sizes = [tile_bytes(painter.window(x * TILE_PX, y * TILE_PX, TILE_PX, TILE_PX)) for y in rows for x in rows]
    return float(np.mean(sizes)) * (side_px / TILE_PX) ** 2
