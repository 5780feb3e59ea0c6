"""Transforms the places of georeferenced textures to the CRS of the surfaces that they are on. The core knows no CRSs and fits an affine map."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from pyproj import CRS

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.ingest.crs_transformer import CrsTransformer

Position = tuple[float, float]


def transform_positions(source: str, target: str, positions: Sequence[Sequence[float]]) -> list[Position] | None:
    """Returns positions in the CRS `target` for those in `source`; not finite where it does not reach. Both are as documents write them: east, north
    if projected, in the authority's order if geographic. None if a name is unknown, or no transformation between the two."""
    try:
        transformer, is_north_first = _transformer(source, target)
    except CrsError:
        return None
    points = np.column_stack([np.asarray(positions, dtype=np.float64).reshape(-1, 2), np.zeros(len(positions))])
    world = transformer.to_world(points)[:, [1, 0] if is_north_first else [0, 1]]
    return [(x, y) for x, y in world.tolist()]


@lru_cache(maxsize=64)
def _transformer(source: str, target: str) -> tuple[CrsTransformer, bool]:
    """Returns the transformer, and whether documents in `target` write the northing first."""
    own, wanted = horizontal_crs(parse_crs(source)), horizontal_crs(parse_crs(target))
    return CrsTransformer(own, wanted), _is_north_first(wanted)


def _is_north_first(crs: CRS) -> bool:
    return bool(crs.is_geographic and crs.axis_info[0].direction == "north")
