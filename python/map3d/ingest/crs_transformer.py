"""From a source's coordinates to the scene's: exact where they are the same system, and honest where they are not."""

import math
import warnings
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info
from pyproj.transformer import TransformerGroup

from map3d.errors import CrsError
from map3d.ingest.crs import horizontal, is_metric, vertical, vertical_name, vertical_unit_m

Points = NDArray[np.float64]
"""(n, 3)."""

_ZONE_PREFIXED: Final = {25831: 31, 25832: 32, 25833: 33}
_METRES_A_DEGREE: Final = 111_320.0


@dataclass(frozen=True)
class Source:
    """How coordinates are written in a file: x, y as east, north when projected; in the authority's order when geographic."""

    crs: CRS

    def xy_first(self, points: Points) -> Points:
        """East (or longitude) first."""
        flat = horizontal(self.crs)
        if flat.is_geographic and flat.axis_info[0].direction == "north":
            return points[:, [1, 0, 2]]
        return points


class Projection:
    """world_from_source. Heights are kept unless a transformation for them is installed; `report` says what was done and how exact it is."""

    def __init__(self, source: CRS, target: CRS) -> None:
        """`target`: the scene's system, projected in metres, with its vertical part if it is known."""
        self._source, self._flat_source, flat_target = Source(source), horizontal(source), horizontal(target)
        self._height_unit_m = vertical_unit_m(source)
        self._same = self._flat_source.equals(flat_target, ignore_axis_order=True)
        self._zone_m = _ZONE_PREFIXED.get(self._flat_source.to_epsg() or 0, 0) * 1e6
        self._prefixed = 0
        self._ways = None if self._same else _best(self._flat_source, flat_target)
        self._transformer = None if self._ways is None else self._ways.transformers[0]
        self._heights = _height_transformer(source, target)
        self._facts: dict[str, Any] = {
            "from": str(source.name),
            "to": str(flat_target.name),
            **self._describe(),
            "heights": self._describe_heights(source, target),
        }

    @property
    def report(self) -> dict[str, Any]:
        return {**self._facts, "zone_prefixed_points": self._prefixed} if self._prefixed else self._facts

    def world(self, points: Points) -> Points:
        """(n, 3) world coordinates; not finite where the source's make no sense. In the same system the numbers stay as they are."""
        local = self._without_zone(self._source.xy_first(np.asarray(points, dtype=np.float64)))
        if self._same and self._heights is None and self._height_unit_m == 1.0:
            return np.ascontiguousarray(local)
        x, y = (local[:, 0], local[:, 1]) if self._transformer is None else self._transformer.transform(local[:, 0], local[:, 1])
        z = local[:, 2] * self._height_unit_m if self._heights is None else self._heights.transform(local[:, 0], local[:, 1], local[:, 2])[2]
        return np.column_stack([x, y, z])

    def world_transforms(self, transforms: Points) -> Points:
        """(m, 12) prototype → source as prototype → world: moved, and turned by the angle between the two systems' norths."""
        if len(transforms) == 0:
            return transforms
        matrices = np.asarray(transforms, dtype=np.float64).reshape(-1, 3, 4)
        at = matrices[:, :, 3]
        world = self.world(at)
        linear = matrices[:, :, :3]
        if not self._same:
            linear = _turn(self.world(self._a_metre_north(at)) - world) @ linear
        return np.concatenate([linear, world[:, :, None]], axis=2).reshape(-1, 12)

    def _a_metre_north(self, points: Points) -> Points:
        moved = points.copy()
        geographic = self._flat_source.is_geographic
        north_first = self._flat_source.axis_info[0].direction == "north"
        moved[:, 0 if geographic and north_first else 1] += 1.0 / _METRES_A_DEGREE if geographic else 1.0
        return moved

    def _without_zone(self, points: Points) -> Points:
        """UTM eastings written with the zone in front (32,691,000 for 691,000)."""
        if not self._zone_m:
            return points
        prefixed = (points[:, 0] >= self._zone_m) & (points[:, 0] < self._zone_m + 1e6)
        if not prefixed.any():
            return points
        self._prefixed += int(prefixed.sum())
        out = points.copy()
        out[prefixed, 0] -= self._zone_m
        return out

    def _describe(self) -> dict[str, Any]:
        if self._transformer is None or self._ways is None:
            return {"operation": "none: the same system", "accuracy_m": 0.0, "ballpark": False}
        accuracy = self._transformer.accuracy
        facts = {
            "operation": self._transformer.description,
            "accuracy_m": accuracy if accuracy is not None and accuracy >= 0 else None,
            "ballpark": "ballpark" in self._transformer.description.lower(),
        }
        if not self._ways.best_available and self._ways.unavailable_operations:
            facts["better_but_not_installed"] = self._ways.unavailable_operations[0].name
        return facts

    def _describe_heights(self, source: CRS, target: CRS) -> str:
        have, want = vertical_name(source), vertical_name(target)
        if self._heights is not None:
            return f"transformed from {have} to {want}: {self._heights.description}"
        if have == want or want is None:
            return f"kept ({have or 'unknown datum'})"
        return f"kept as {have or 'of unknown datum'}: no grid to {want} is installed, so they may differ by metres"


def choose_target(source: CRS, points: Points) -> CRS:
    """The scene's system when the first asset is to decide: its own if projected in metres, else the UTM zone of its middle."""
    if is_metric(source):
        return source
    flat = horizontal(source)
    sane = points[np.isfinite(points).all(axis=1)]
    if len(sane) == 0:
        raise CrsError("the source has no finite coordinates to choose a UTM zone by; name the scene's system with --crs")
    middle = Source(source).xy_first((sane.min(axis=0, keepdims=True) + sane.max(axis=0, keepdims=True)) / 2)
    lon, lat = (
        (middle[0, 0], middle[0, 1]) if flat.is_geographic else Transformer.from_crs(flat, 4326, always_xy=True).transform(middle[0, 0], middle[0, 1])
    )
    if not (-180 <= lon <= 180 and -80 <= lat <= 84):
        raise CrsError(f"no UTM zone at longitude {lon:g}, latitude {lat:g}; name the scene's system with --crs, or the file's if its own is wrong")
    return _utm(flat, lon, lat)


def _utm(flat: CRS, lon: float, lat: float) -> CRS:
    place = AreaOfInterest(lon, lat, lon, lat)
    datum = flat.geodetic_crs.name if flat.geodetic_crs is not None else None
    found = query_utm_crs_info(datum_name=datum, area_of_interest=place) or query_utm_crs_info(datum_name="WGS 84", area_of_interest=place)
    plain = [info for info in found if info.name.startswith(f"{datum} / UTM zone") and not info.name.endswith(")")] or found
    return CRS.from_epsg(int(min(plain, key=lambda info: int(info.code)).code))


def _best(source: CRS, target: CRS) -> TransformerGroup:
    """Its first transformer is the most exact one that is installed; a ballpark one only where there is no other."""
    for ballpark in (False, True):
        group = _group(source, target, ballpark)
        if group.transformers:
            return group
    raise CrsError(f"no way from {source.name} to {target.name} is known; name another system with --crs")


def _height_transformer(source: CRS, target: CRS) -> Transformer | None:
    have, want = vertical(source), vertical(target)
    if have is None or want is None or have.equals(want):
        return None
    group = _group(source, target, False)
    return group.transformers[0] if group.transformers else None


def _group(source: CRS, target: CRS, ballpark: bool) -> TransformerGroup:
    """Without the warning that a better way is not installed: the import's report says it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return TransformerGroup(source, target, always_xy=True, allow_ballpark=ballpark)


def _turn(north: Points) -> NDArray[np.float64]:
    """(m, 3, 3) turns about z that bring +y to the given directions."""
    angle = np.array([math.atan2(-x, y) for x, y, _ in north])
    c, s = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([np.stack([c, -s, zero], 1), np.stack([s, c, zero], 1), np.stack([zero, zero, one], 1)], 1)
