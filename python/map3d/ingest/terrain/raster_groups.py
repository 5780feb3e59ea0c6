"""Groups of rasters by where they lie: one with a wrong CRS must not stretch the terrain of all others over a continent."""

from collections.abc import Sequence
from math import hypot
from pathlib import Path
from typing import Final

import numpy as np
from pyproj import CRS

from map3d.ingest.terrain.raster_georeference import PlaneTransformer, RasterGeoreference, open_raster, place_of, raster_crs
from map3d.ingest.terrain.raster_placement import NEAR_M

Bounds = tuple[float, float, float, float]
"""West, south, east, north in the plane of the scene; infinite where a CRS does not reach."""

SIZES: Final = 3.0
"""Rasters belong together up to a gap of this many diagonals of the larger one, and at least NEAR_M."""


def split_far(paths: Sequence[Path], target: CRS | None, stated_crs: str | None) -> tuple[dict[Path, Bounds], list[Path], list[tuple[Path, float]]]:
    """Returns the bounds of the rasters, those that lie together, and the others with their distances in metres, if more than half of them lie
    together; else all of them. `target`: the scene's CRS, None for local metres. Raises CrsError."""
    by_path = {path: _bounds(path, target, stated_crs) for path in paths}
    bounds = list(by_path.values())
    largest = max(_groups(bounds), key=len, default=[])
    if 2 * len(largest) <= len(paths):
        return by_path, list(paths), []
    far = [(path, min(_gap(bounds[k], bounds[other]) for other in largest)) for k, path in enumerate(paths) if k not in largest]
    return by_path, [paths[k] for k in largest], far


def _bounds(path: Path, target: CRS | None, stated_crs: str | None) -> Bounds:
    with open_raster(path) as raster:
        crs = raster_crs(raster, target, stated_crs)
        rows, columns = (np.array([0.0, 0.0, 1.0, 1.0]) * raster.height, np.array([0.0, 1.0, 0.0, 1.0]) * raster.width)
        x, y = PlaneTransformer(crs, target, place_of(raster, crs))(*RasterGeoreference(raster, crs).plane_from_pixels(rows, columns))
    return (float(np.min(x)), float(np.min(y)), float(np.max(x)), float(np.max(y)))


def _groups(bounds: Sequence[Bounds]) -> list[list[int]]:
    """Returns the numbers of the boxes that lie together, in order."""
    groups: list[list[int]] = []
    for number, box in enumerate(bounds):
        near = [group for group in groups if any(_together(box, bounds[other]) for other in group)]
        groups = [group for group in groups if group not in near] + [sorted([number, *(other for group in near for other in group)])]
    return groups


def _together(one: Bounds, other: Bounds) -> bool:
    size = max(hypot(box[2] - box[0], box[3] - box[1]) for box in (one, other))
    return _gap(one, other) <= max(NEAR_M, SIZES * size)


def _gap(one: Bounds, other: Bounds) -> float:
    return hypot(*(max(one[k] - other[k + 2], other[k] - one[k + 2], 0.0) for k in (0, 1)))
