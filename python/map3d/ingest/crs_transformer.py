"""Transforms source coordinates to the scene's CRS: bit-exact within one CRS; otherwise the report states the accuracy."""

import math
import warnings
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.transformer import TransformerGroup

from map3d.geometry.crs import horizontal_crs, vertical_crs, vertical_crs_name, vertical_unit_m
from map3d.geometry.transformations import LonLat, find_transformation

Points = NDArray[np.float64]
"""(n, 3)."""

_UTM_ZONES: Final = {25831: 31, 25832: 32, 25833: 33}
"""EPSG code → zone that some files write in front of the easting."""
_METRES_PER_DEGREE: Final = 111_320.0


class CrsTransformer:
    """Transforms (n, 3) points. Heights stay unchanged unless PROJ has a transformation for them; `report` states operation and accuracy.

    Files write x, y as east, north if projected, and in the authority's axis order if geographic.
    """

    def __init__(self, source: CRS, target: CRS, place: LonLat | None = None, height_unit_m: float | None = None) -> None:
        """`target`: the scene's CRS, projected in metres, with its vertical part if known; `place`: of the points; `height_unit_m`: that of the
        heights if `source` does not state it. Raises CrsError without a transformation."""
        self._source, self._target = horizontal_crs(source), horizontal_crs(target)
        self._height_unit_m = vertical_unit_m(source) if height_unit_m is None else height_unit_m
        self._same_crs = self._source.equals(self._target, ignore_axis_order=True)
        self._zone_offset_m = _UTM_ZONES.get(self._source.to_epsg() or 0, 0) * 1e6
        self._zone_prefixed_points = 0
        self.transformation = find_transformation(source, target, place)
        self._height_transformer = _find_height_transformer(source, target)
        self._description: dict[str, Any] = {
            "from": str(source.name),
            "to": str(self._target.name),
            **self.transformation.report,
            "heights": self._describe_heights(source, target),
        }

    @property
    def report(self) -> dict[str, Any]:
        count = self._zone_prefixed_points
        return {**self._description, "zone_prefixed_points": count} if count else self._description

    def to_world(self, points: Points) -> Points:
        """Returns (n, 3) world coordinates; not finite where the source's are invalid. Within one CRS the numbers stay unchanged."""
        local = self._remove_zone_prefix(_east_first(self._source, np.asarray(points, dtype=np.float64)))
        if self._same_crs and self._height_transformer is None and self._height_unit_m == 1.0:
            return np.ascontiguousarray(local)
        x, y = self.transformation(local[:, 0], local[:, 1])
        if self._height_transformer is None:
            z = local[:, 2] * self._height_unit_m
        else:
            z = self._height_transformer.transform(local[:, 0], local[:, 1], local[:, 2])[2]
        return np.column_stack([x, y, z])

    def transforms_to_world(self, transforms: Points) -> Points:
        """Converts (m, 12) prototype-to-source transforms to prototype-to-world: moves them and rotates them by the angle between the two norths."""
        if len(transforms) == 0:
            return transforms
        matrices = np.asarray(transforms, dtype=np.float64).reshape(-1, 3, 4)
        origins = matrices[:, :, 3]
        world = self.to_world(origins)
        linear = matrices[:, :, :3]
        if not self._same_crs:
            linear = _rotation_from_north(self.to_world(self._step_north(origins)) - world) @ linear
        return np.concatenate([linear, world[:, :, None]], axis=2).reshape(-1, 12)

    def _step_north(self, points: Points) -> Points:
        """Moves the points by about one metre."""
        moved = points.copy()
        geographic = self._source.is_geographic
        moved[:, 0 if geographic and _is_north_first(self._source) else 1] += 1.0 / _METRES_PER_DEGREE if geographic else 1.0
        return moved

    def _remove_zone_prefix(self, points: Points) -> Points:
        """Removes the zone from UTM eastings that carry it (32,691,000 for 691,000)."""
        if not self._zone_offset_m:
            return points
        prefixed = (points[:, 0] >= self._zone_offset_m) & (points[:, 0] < self._zone_offset_m + 1e6)
        if not prefixed.any():
            return points
        self._zone_prefixed_points += int(prefixed.sum())
        out = points.copy()
        out[prefixed, 0] -= self._zone_offset_m
        return out

    def _describe_heights(self, source: CRS, target: CRS) -> str:
        own, wanted = vertical_crs_name(source), vertical_crs_name(target)
        if self._height_transformer is not None:
            return f"transformed from {own} to {wanted}: {self._height_transformer.description}"
        if own == wanted or wanted is None:
            return f"unchanged ({own or 'unknown datum'})"
        return f"unchanged ({own or 'unknown datum'}): no grid to {wanted} is installed, so they may be off by metres"


def _is_north_first(horizontal: CRS) -> bool:
    return bool(horizontal.axis_info[0].direction == "north")


def _east_first(horizontal: CRS, points: Points) -> Points:
    return points[:, [1, 0, 2]] if horizontal.is_geographic and _is_north_first(horizontal) else points


def _find_height_transformer(source: CRS, target: CRS) -> Transformer | None:
    own, wanted = vertical_crs(source), vertical_crs(target)
    if own is None or wanted is None or own.equals(wanted):
        return None
    group = _query_operations(source, target, False)
    return group.transformers[0] if group.transformers else None


def _query_operations(source: CRS, target: CRS, ballpark: bool) -> TransformerGroup:
    """Suppresses the warning that a better operation is not installed: the import report contains it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return TransformerGroup(source, target, always_xy=True, allow_ballpark=ballpark)


def _rotation_from_north(north: Points) -> NDArray[np.float64]:
    """Returns (m, 3, 3) rotations about z that turn +y towards each vector."""
    angle = np.array([math.atan2(-x, y) for x, y, _ in north])
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([np.stack([c, -s, zero], 1), np.stack([s, c, zero], 1), np.stack([zero, zero, one], 1)], 1)
