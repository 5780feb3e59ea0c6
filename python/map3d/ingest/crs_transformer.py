"""Transforms source coordinates to the scene's CRS: bit-exact within one CRS; otherwise the report states the accuracy."""

import math
import warnings
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info
from pyproj.transformer import TransformerGroup

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, is_metric, vertical_crs, vertical_crs_name, vertical_unit_m

Points = NDArray[np.float64]
"""(n, 3)."""

_UTM_ZONES: Final = {25831: 31, 25832: 32, 25833: 33}
"""EPSG code → zone that some files write in front of the easting."""
_METRES_PER_DEGREE: Final = 111_320.0


class CrsTransformer:
    """Transforms (n, 3) points. Heights stay unchanged unless PROJ has a transformation for them; `report` states operation and accuracy.

    Files write x, y as east, north if projected, and in the authority's axis order if geographic.
    """

    def __init__(self, source: CRS, target: CRS) -> None:
        """`target`: the scene's CRS, projected in metres, with its vertical part if known. Raises CrsError without a transformation."""
        self._source, self._target = horizontal_crs(source), horizontal_crs(target)
        self._height_unit_m = vertical_unit_m(source)
        self._same_crs = self._source.equals(self._target, ignore_axis_order=True)
        self._zone_offset_m = _UTM_ZONES.get(self._source.to_epsg() or 0, 0) * 1e6
        self._zone_prefixed_points = 0
        self._operations = None if self._same_crs else _find_operations(self._source, self._target)
        self._transformer = None if self._operations is None else self._operations.transformers[0]
        self._height_transformer = _find_height_transformer(source, target)
        self._description: dict[str, Any] = {
            "from": str(source.name),
            "to": str(self._target.name),
            **self._describe_operation(),
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
        x, y = (local[:, 0], local[:, 1]) if self._transformer is None else self._transformer.transform(local[:, 0], local[:, 1])
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

    def _describe_operation(self) -> dict[str, Any]:
        if self._transformer is None or self._operations is None:
            return {"operation": "none: same CRS", "accuracy_m": 0.0, "ballpark": False}
        accuracy = self._transformer.accuracy
        description = {
            "operation": self._transformer.description,
            "accuracy_m": accuracy if accuracy is not None and accuracy >= 0 else None,
            "ballpark": "ballpark" in self._transformer.description.lower(),
        }
        if not self._operations.best_available and self._operations.unavailable_operations:
            description["better_but_not_installed"] = self._operations.unavailable_operations[0].name
        return description

    def _describe_heights(self, source: CRS, target: CRS) -> str:
        own, wanted = vertical_crs_name(source), vertical_crs_name(target)
        if self._height_transformer is not None:
            return f"transformed from {own} to {wanted}: {self._height_transformer.description}"
        if own == wanted or wanted is None:
            return f"unchanged ({own or 'unknown datum'})"
        return f"unchanged ({own or 'unknown datum'}): no grid to {wanted} is installed, so they may be off by metres"


def choose_scene_crs(source: CRS, points: Points) -> CRS:
    """Chooses the scene's CRS by its first asset: the asset's own if projected in metres, else the UTM zone of its centre. Raises CrsError."""
    if is_metric(source):
        return source
    horizontal = horizontal_crs(source)
    finite = points[np.isfinite(points).all(axis=1)]
    if len(finite) == 0:
        raise CrsError("cannot choose a UTM zone: the file has no finite coordinates; set the scene's CRS with --crs")
    x, y, _ = _east_first(horizontal, (finite.min(axis=0, keepdims=True) + finite.max(axis=0, keepdims=True)) / 2)[0]
    lon, lat = (x, y) if horizontal.is_geographic else Transformer.from_crs(horizontal, 4326, always_xy=True).transform(x, y)
    if not (-180 <= lon <= 180 and -80 <= lat <= 84):
        raise CrsError(
            f"longitude {lon:g}, latitude {lat:g} is outside all UTM zones; set the scene's CRS with --crs, or the file's if its own is wrong"
        )
    return _find_utm_zone(horizontal, lon, lat)


def _is_north_first(horizontal: CRS) -> bool:
    return bool(horizontal.axis_info[0].direction == "north")


def _east_first(horizontal: CRS, points: Points) -> Points:
    return points[:, [1, 0, 2]] if horizontal.is_geographic and _is_north_first(horizontal) else points


def _find_utm_zone(horizontal: CRS, lon: float, lat: float) -> CRS:
    """Prefers the zone on the datum of `horizontal`, else takes the one on WGS 84."""
    point = AreaOfInterest(lon, lat, lon, lat)
    datum = horizontal.geodetic_crs.name if horizontal.geodetic_crs is not None else None
    zones = query_utm_crs_info(datum_name=datum, area_of_interest=point) or query_utm_crs_info(datum_name="WGS 84", area_of_interest=point)
    plain = [zone for zone in zones if zone.name.startswith(f"{datum} / UTM zone") and not zone.name.endswith(")")] or zones
    return CRS.from_epsg(int(min(plain, key=lambda zone: int(zone.code)).code))


def _find_operations(source: CRS, target: CRS) -> TransformerGroup:
    """Returns the installed operations, most accurate first; ballpark operations only if there is no other."""
    for ballpark in (False, True):
        group = _query_operations(source, target, ballpark)
        if group.transformers:
            return group
    raise CrsError(f"no transformation from {source.name} to {target.name} is known; name another CRS with --crs")


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
