"""Checks whether coordinates fit the CRS that a file is labelled with: their axis order, their unit, and the area that the CRS is meant for."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from map3d.errors import CrsError
from map3d.geometry.area_of_use import AreaOfUse
from map3d.geometry.crs import horizontal_crs
from map3d.geometry.places import Place, find_place
from map3d.ingest.findings import finding

Points = NDArray[np.float64]
"""(n, 3), in the file's order of axes."""

NEAR_TOWN_KM: Final = 100.0
FAR_FROM_TOWN_KM: Final = 40.0
TIMES_NEARER: Final = 4.0
"""Swapped axes are assumed without other evidence if they lead to a town of the table and the axes as written lead this many times farther."""

MAX_EXTENT_DEG: Final = 5.0
LOCAL_M: Final = 100_000.0
SAMPLE: Final = 50_000
MAX_EDGE_M: Final = 100.0
RIGHT_ANGLE_COS: Final = 0.02
MIN_RIGHT_ANGLES: Final = 8
_METRES_PER_DEGREE: Final = 111_320.0

_LITERAL: Final = ("urn:ogc:def:crs", "ogc:", "http")
"""Beginnings of names that state their axis order: as an option they are taken at their word."""


class CoordinateCheck:
    """Decides the axis order by the first positions of a file, and counts positions outside the area of use of its CRS."""

    def __init__(self, source: CRS, label: str, *, stated: bool, target: CRS | None = None, axes_known: bool = False) -> None:
        """`label`: the name of `source` in the file or, if `stated`, in the option; `target`: the scene's CRS, if it has one; `axes_known`: the
        points are in the order of the CRS."""
        self._horizontal = horizontal_crs(source)
        self._label, self._stated = label.strip(), stated
        self._literal = axes_known or (stated and self._label.lower().startswith(_LITERAL))
        self._north_first = bool(self._horizontal.is_geographic and self._horizontal.axis_info[0].direction == "north")
        self._to_degrees = Transformer.from_crs(self._horizontal, "EPSG:4326", always_xy=True)
        own = AreaOfUse.of(self._horizontal)
        scene = None if target is None else AreaOfUse.of(horizontal_crs(target))
        self._areas = [area for area in (own, scene) if area is not None]
        self._box = None if own is None else own.source_box(self._horizontal)
        self._swap: bool | None = None
        self._axes_warning: dict[str, Any] | None = None
        self._points = self._outside = 0
        self._outside_example = self._outside_hint = ""
        self.place: Place | None = None
        """The place of the first positions."""

    def ordered(self, points: Points) -> Points:
        """Returns the points in the axis order that the CRS expects. Raises CrsError if the first ones cannot be coordinates of the CRS."""
        if self._swap is None:
            self._decide(points)
        if self._swap:
            points = np.ascontiguousarray(points[:, [1, 0, 2]])
        self._count_outside(points)
        return points

    def ordered_transforms(self, transforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns (m, 12) prototype-to-source transforms in the axis order that the CRS expects."""
        if self._swap is None and len(transforms):
            self.ordered(transforms.reshape(-1, 3, 4)[:, :, 3])
        if not self._swap:
            return transforms
        swapped = transforms.copy()
        swapped[:, [3, 7]] = transforms[:, [7, 3]]
        return swapped

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Returns what is odd, as findings of a report."""
        found = [] if self._axes_warning is None else [self._axes_warning]
        if self._outside:
            hint = self._outside_hint if 2 * self._outside > self._points else ""
            found.append(finding("points-outside-area-of-use", self._outside, self._outside_example + hint, name=self._horizontal.name))
        return found

    def _decide(self, points: Points) -> None:
        finite = points[np.isfinite(points).all(axis=1)][:SAMPLE]
        if not len(finite):
            return
        middle = np.median(finite[:, :2], axis=0)
        self._refuse_wrong_unit(finite, middle)
        written, swapped = self._degrees(middle), self._degrees(middle[::-1])
        self._swap = not self._literal and swapped is not None and self._is_swapped(finite, written, swapped)
        position = swapped if self._swap else written
        self.place = None if position is None else find_place(*position)
        if self._swap:
            self._axes_warning = self._describe_swap(middle, written)

    def _degrees(self, xy: NDArray[np.float64]) -> tuple[float, float] | None:
        """Returns longitude and latitude of a position in the file's order of axes; None if it is not on Earth."""
        x, y = (xy[1], xy[0]) if self._north_first else (xy[0], xy[1])
        lon, lat = self._to_degrees.transform(float(x), float(y))
        on_earth = np.isfinite([lon, lat]).all() and abs(lon) <= 360.0 and abs(lat) <= 90.0
        return (float(lon), float(lat)) if on_earth else None

    def _is_swapped(self, points: Points, written: tuple[float, float] | None, swapped: tuple[float, float]) -> bool:
        if not self._fits(*swapped):
            return False
        if written is None or not self._fits(*written):
            return True
        if not self._horizontal.is_geographic:
            return False
        right_angles = self._compare_right_angles(points)
        if right_angles:
            return right_angles < 0
        here, there = find_place(*written).distance_km, find_place(*swapped).distance_km
        return there <= NEAR_TOWN_KM and here > max(FAR_FROM_TOWN_KM, TIMES_NEARER * there)

    def _fits(self, lon: float, lat: float) -> bool:
        return all(area.contains(lon, lat) for area in self._areas)

    def _compare_right_angles(self, points: Points) -> int:
        """Returns 1 if buildings are rectangular with the axes as written, -1 if with swapped axes, 0 if undecided.

        A degree of longitude is shorter than one of latitude, so with swapped axes rectangles become oblique, except those along the axes.
        """
        right = []
        for lat, lon in ((0, 1), (1, 0)) if self._north_first else ((1, 0), (0, 1)):
            scale = _METRES_PER_DEGREE * np.cos(np.radians(np.median(points[:, lat])))
            right.append(_right_corners(np.column_stack([points[:, lon] * scale, points[:, lat] * _METRES_PER_DEGREE, points[:, 2]])))
        written, swapped = int((right[0] & ~right[1]).sum()), int((right[1] & ~right[0]).sum())
        if max(written, swapped) < MIN_RIGHT_ANGLES or max(written, swapped) < 4 * min(written, swapped):
            return 0
        return 1 if written > swapped else -1

    def _refuse_wrong_unit(self, points: Points, middle: NDArray[np.float64]) -> None:
        name = f"{self._label} ({self._horizontal.name})" if 0 < len(self._label) < 40 else str(self._horizontal.name)
        numbers = f"{middle[0]:.10g} {middle[1]:.10g}"
        if self._horizontal.is_geographic:
            low, high = np.percentile(points[:, :2], [5, 95], axis=0)
            if np.abs(middle).max() > 360.0 or (not self._stated and (high - low).min() > MAX_EXTENT_DEG):
                extent = "are no degrees" if np.abs(middle).max() > 360.0 else f"extend over {(high - low).max():.0f}°"
                raise CrsError(
                    f"the label {name} is in degrees, but the coordinates, e.g. {numbers}, {extent}; "
                    "name the right CRS with --crs, e.g. --crs EPSG:25832, or give --crs local for plain metres"
                )
            return
        if not (np.abs(middle) <= 180.0).all() or self._reaches(middle):
            return
        for option, lon, lat in (("OGC:CRS84", middle[0], middle[1]), ("EPSG:4326", middle[1], middle[0])):
            if self._areas and abs(lat) <= 90.0 and self._fits(float(lon), float(lat)):
                raise CrsError(
                    f"the label {name} is in metres, but the coordinates, e.g. {numbers}, are degrees {find_place(float(lon), float(lat))}; "
                    f"give --crs {option} to read them as degrees, or --crs local for plain metres"
                )

    def _reaches(self, middle: NDArray[np.float64]) -> bool:
        position = self._degrees(middle)
        return position is not None and self._fits(*position)

    def _describe_swap(self, middle: NDArray[np.float64], written: tuple[float, float] | None) -> dict[str, Any]:
        found = "northing-easting" if not self._horizontal.is_geographic else "longitude-latitude" if self._north_first else "latitude-longitude"
        example = f"{middle[0]:.10g} {middle[1]:.10g} is {self.place}"
        if self._horizontal.is_geographic and written is not None:
            option = f"urn:ogc:def:crs:EPSG::{self._horizontal.to_epsg()}" if self._north_first else "OGC:CRS84"
            example += f"; in the order of {self._label[:80]} it would be {find_place(*written)}: give --crs {option} if that is right"
        return finding(f"axes-read-as-{found}", 1, example)

    def _count_outside(self, points: Points) -> None:
        """Counts points. The label is in doubt only if most of them are outside; a few are strays."""
        if self._box is None:
            return
        self._points += len(points)
        west, south, east, north = self._box
        x, y = (points[:, 1], points[:, 0]) if self._north_first else (points[:, 0], points[:, 1])
        outside = (x < west) | (x > east) | (y < south) | (y > north)
        if not outside.any():
            return
        if not self._outside:
            self._describe_outside(points[np.flatnonzero(outside)[0]])
        self._outside += int(outside.sum())

    def _describe_outside(self, point: NDArray[np.float64]) -> None:
        position = self._degrees(point[:2])
        where = "nowhere on Earth" if position is None else str(find_place(*position))
        is_local = np.abs(point[:2]).max() < LOCAL_M
        self._outside_example = f"{point[0]:.10g} {point[1]:.10g} is {where}"
        self._outside_hint = "; give --crs local for plain metres" if is_local else "; name the right CRS with --crs if this is wrong"


def _right_corners(points: Points) -> NDArray[np.bool_]:
    """Returns, for each three consecutive points, whether they form a level right angle with sides of the length of walls."""
    before, after = points[:-2] - points[1:-1], points[2:] - points[1:-1]
    lengths = np.stack([np.hypot(side[:, 0], side[:, 1]) for side in (before, after)])
    level = (np.abs(np.stack([before[:, 2], after[:, 2]])) <= 0.01 * lengths).all(axis=0) & ((lengths > 1.0) & (lengths < MAX_EDGE_M)).all(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.abs((before[:, :2] * after[:, :2]).sum(axis=1)) / lengths.prod(axis=0)
    right: NDArray[np.bool_] = level & (cosine < RIGHT_ANGLE_COS)
    return right
