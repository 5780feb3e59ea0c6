"""Checks whether coordinates fit the CRS that a file is labelled with: their axis order, their unit, and the area that the CRS is meant for."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from map3d.errors import CrsError
from map3d.geometry.area_of_use import AreaOfUse
from map3d.geometry.crs import horizontal_crs
from map3d.geometry.places import Place, find_place
from map3d.geometry.transformations import LonLat
from map3d.ingest.axis_order import facing_axes, is_north_first, labelled_axes, named_axes, right_angled_axes
from map3d.ingest.document_sample import Ring
from map3d.ingest.evidence import Evidence
from map3d.ingest.findings import finding
from map3d.ingest.zone_prefix import prefix_shifts_m
from map3d.requests.reading import Axes

Points = NDArray[np.float64]
"""(n, 3), in the file's order of axes."""

NEAR_TOWN_KM: Final = 100.0
FAR_FROM_TOWN_KM: Final = 40.0
TIMES_NEARER: Final = 4.0
"""An order of axes is assumed without other evidence if it leads to a town and the other one leads this many times farther."""

MAX_EXTENT_DEG: Final = 5.0
LOCAL_M: Final = 100_000.0
NO_PLACE_M: Final = 1000.0
"""Projected coordinates nearer to 0, 0 are those of a model without a place, whatever its label."""
SAMPLE: Final = 50_000

_LITERAL: Final = ("urn:ogc:def:crs", "ogc:", "http")
"""Beginnings of names that state their axis order: as an option they are taken at their word."""

Places = dict[Axes, LonLat | None]

_WORDS: Final = {
    (True, "east-north"): "longitude-latitude",
    (True, "north-east"): "latitude-longitude",
    (False, "east-north"): "easting-northing",
    (False, "north-east"): "northing-easting",
}


@dataclass(frozen=True)
class AxisDecision:
    """`by`: the file itself or the user, the other files or the scene, a town, or the form of the name alone. `places`: longitude and
    latitude of the middle by order, None if not on Earth."""

    axes: Axes
    by: Literal["file", "others", "town", "name"]
    places: Places


class CoordinateCheck:
    """Decides the axis order by the first positions of a file, and counts positions outside the area of use of its CRS."""

    def __init__(
        self,
        source: CRS,
        label: str,
        *,
        stated: bool,
        target: CRS | None = None,
        axes_known: bool = False,
        evidence: Evidence | None = None,
    ) -> None:
        """`label`: the name of `source` in the file or, if `stated`, in the option; `target`: the scene's CRS, if it has one; `axes_known`: the
        points are in the order of the CRS, east first if projected; `evidence`: what else is known of the document."""
        self._horizontal = horizontal_crs(source)
        self._label, self._stated, self._axes_known = label.strip(), stated, axes_known
        self._evidence = evidence or Evidence()
        self._is_geographic = bool(self._horizontal.is_geographic)
        self._expected: Axes = "north-east" if self._is_geographic and is_north_first(self._horizontal) else "east-north"
        self._to_degrees = Transformer.from_crs(self._horizontal, "EPSG:4326", always_xy=True)
        self._area = AreaOfUse.of(self._horizontal)
        self._scene_area = None if target is None else AreaOfUse.of(horizontal_crs(target))
        self._box = None if self._area is None else self._area.source_box(self._horizontal)
        self._swap: bool | None = None
        self._shift_m = 0.0
        """Added to eastings whose zone is written other than the CRS expects it."""
        self._axes_findings: list[dict[str, Any]] = []
        self._points = self._outside = 0
        self._outside_example = self._outside_hint = ""
        self.axes: Axes = "auto"
        """The order of axes, once it is decided."""
        self.place: Place | None = None
        """The place of the middle of the file."""
        self.middle: NDArray[np.float64] | None = None
        """(2,), the median of its positions, in the order that the CRS expects."""

    def ordered(self, points: Points) -> Points:
        """Returns the points in the axis order that the CRS expects. Raises CrsError if the first ones cannot be coordinates of the CRS."""
        if self._swap is None:
            self._decide(points)
        if self._swap:
            points = np.ascontiguousarray(points[:, [1, 0, 2]])
        if self._shift_m:
            points = points + np.array([self._shift_m, 0.0, 0.0])
        self._count_outside(points)
        return points

    def ordered_transforms(self, transforms: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns (m, 12) prototype-to-source transforms in the axis order that the CRS expects."""
        if self._swap is None and len(transforms):
            self.ordered(transforms.reshape(-1, 3, 4)[:, :, 3])
        if not self._swap and not self._shift_m:
            return transforms
        ordered = transforms.copy()
        if self._swap:
            ordered[:, [3, 7]] = transforms[:, [7, 3]]
        ordered[:, 3] += self._shift_m
        return ordered

    @property
    def findings(self) -> list[dict[str, Any]]:
        """Returns what is odd, as findings of a report."""
        found = list(self._axes_findings)
        if self._outside:
            hint = self._outside_hint if 2 * self._outside > self._points else ""
            found.append(finding("points-outside-area-of-use", self._outside, self._outside_example + hint, name=self._horizontal.name))
        return found

    def _decide(self, points: Points) -> None:
        finite = self._positions(points)
        if not len(finite):
            return
        middle = np.median(finite[:, :2], axis=0)
        self._refuse_wrong_unit(finite, middle)
        decision = self.decision(finite, middle)
        self._swap = decision.axes != self._expected
        self.axes = decision.axes
        self.middle = (middle[::-1] if self._swap else middle) + np.array([self._shift_m, 0.0])
        position = decision.places[decision.axes]
        self.place = None if position is None else find_place(*position)
        self._axes_findings = list(self._describe_axes(decision, middle))
        if self._shift_m:
            read = f"{self.middle[0]:.10g} {self.middle[1]:.10g}, {self.place}"
            self._axes_findings.append(finding("easting-zone-prefix", 1, f"{middle[0]:.10g} {middle[1]:.10g} is read as {read}"))

    def _positions(self, points: Points) -> Points:
        """Returns the positions of the sample or the first ones of the file, whichever are more. Of the sample, those of prototypes do not count,
        which have coordinates of their own around 0, 0."""
        rings = self._rings()
        sampled = np.concatenate([ring.points for ring in rings]) if rings else np.zeros((0, 3))
        if not self._is_geographic:
            sampled = sampled[np.abs(sampled[:, :2]).max(axis=1, initial=0.0) > NO_PLACE_M]
        chosen = points if len(points) >= len(sampled) else sampled
        finite: Points = chosen[np.isfinite(chosen).all(axis=1)][:SAMPLE]
        return finite

    def _rings(self) -> list[Ring]:
        return self._evidence.sample.rings_of(None if self._stated else self._label)

    def decision(self, points: Points, middle: NDArray[np.float64]) -> AxisDecision:
        """Decides the order of axes. `points`: finite; `middle`: (2,), their median."""
        self._shift_m = self._find_shift(middle)
        places: Places = {"east-north": self._degrees(*middle), "north-east": self._degrees(*middle[::-1])}
        axes = self._own_axes(points, places)
        if axes != "auto":
            return AxisDecision(axes, "file", places)
        others, by_town = self._axes_of_others(places), _nearer_town(places)
        if others != "auto":
            return AxisDecision(others, "others", places)
        if by_town != "auto":
            return AxisDecision(by_town, "town", places)
        by_name = named_axes(self._label, self._horizontal)
        if by_name == "auto" or (not self._is_geographic and np.abs(middle).max() < NO_PLACE_M):
            return AxisDecision(self._expected, "name", places)
        return AxisDecision(by_name, "name", places)

    def _own_axes(self, points: Points, places: Places) -> Axes:
        """Returns the order that the file itself, or the user, states; "auto" where both are possible."""
        if self._axes_known:
            return self._expected
        if self._evidence.axes != "auto":
            return self._evidence.axes
        by_name = named_axes(self._label, self._horizontal)
        if self._stated and self._label.lower().startswith(_LITERAL):
            return self._expected if by_name == "auto" else by_name
        fitting = [axes for axes, place in places.items() if place is not None and self._fits(*place)]
        if len(fitting) < 2:
            return fitting[0] if fitting else self._expected
        labelled = self._labelled()
        if labelled != "auto":
            return labelled
        if not self._is_geographic and not is_north_first(self._horizontal):
            return self._expected
        right_angled = right_angled_axes(points) if self._is_geographic else "auto"
        if right_angled != "auto":
            return right_angled
        facing, by_town = facing_axes(self._rings(), self._horizontal), _nearer_town(places)
        return facing if by_town in ("auto", facing) else "auto"

    def _labelled(self) -> Axes:
        labels = self._evidence.sample.axis_labels
        known = list(labels.values())[:1] if self._stated else [labels[self._label]] if self._label in labels else []
        return labelled_axes(known[0]) if known else "auto"

    def _axes_of_others(self, places: Places) -> Axes:
        """Returns the order of the other files, or the only one that leads into the area of the scene's CRS."""
        if self._evidence.followed_axes != "auto" or self._scene_area is None:
            return self._evidence.followed_axes
        inside = [axes for axes, place in places.items() if place is not None and self._scene_area.contains(*place)]
        return inside[0] if len(inside) == 1 else "auto"

    def _find_shift(self, middle: NDArray[np.float64]) -> float:
        """Returns what is added to eastings so that they lead into the area of the CRS, into which they do not lead as they are."""
        self._shift_m = 0.0
        if self._area is None or self._axes_known or self._reaches(middle):
            return 0.0
        for shift_m in prefix_shifts_m(self._horizontal):
            self._shift_m = shift_m
            if self._reaches(middle):
                return shift_m
        return 0.0

    def _degrees(self, east: float, north: float) -> LonLat | None:
        """Returns longitude and latitude; None if the position is not on Earth."""
        lon, lat = self._to_degrees.transform(float(east) + self._shift_m, float(north))
        on_earth = np.isfinite([lon, lat]).all() and abs(lon) <= 360.0 and abs(lat) <= 90.0
        return (float(lon), float(lat)) if on_earth else None

    def _as_expected(self, xy: NDArray[np.float64]) -> LonLat | None:
        """Returns longitude and latitude of an ordered position."""
        return self._degrees(*((xy[1], xy[0]) if self._expected == "north-east" else (xy[0] - self._shift_m, xy[1])))

    def _fits(self, lon: float, lat: float) -> bool:
        return self._area is None or self._area.contains(lon, lat)

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
            if self._area is not None and abs(lat) <= 90.0 and self._fits(float(lon), float(lat)):
                raise CrsError(
                    f"the label {name} is in metres, but the coordinates, e.g. {numbers}, are degrees {find_place(float(lon), float(lat))}; "
                    f"give --crs {option} to read them as degrees, or --crs local for plain metres"
                )

    def _reaches(self, middle: NDArray[np.float64]) -> bool:
        positions = (self._degrees(*middle), self._degrees(*middle[::-1]))
        return any(position is not None and self._fits(*position) for position in positions)

    def _describe_axes(self, decision: AxisDecision, middle: NDArray[np.float64]) -> Iterator[dict[str, Any]]:
        """Yields what is odd about the order: other than the label says, or not told by the file."""
        if self._axes_known or self._evidence.axes != "auto":
            return
        other: Axes = "east-north" if decision.axes == "north-east" else "north-east"
        words, elsewhere = _WORDS[self._is_geographic, decision.axes], decision.places[other]
        numbers = f"{middle[0]:.10g} {middle[1]:.10g} is {self.place}"
        differs = elsewhere is not None and self._fits(*elsewhere) and (self._is_geographic or np.abs(middle).max() >= NO_PLACE_M)
        there = f"; in the other order it would be {find_place(*elsewhere)}" if elsewhere is not None and differs else ""
        if decision.by in ("others", "name") and differs and _nearer_town(decision.places) != decision.axes:
            code = "axes-like-other-files" if decision.by == "others" else "axes-ambiguous"
            yield finding(code, 1, f"read as {words.replace('-', ', ')}, {numbers}{there}: give --axes {other} if that is right")
            return
        if not self._swap or decision.axes in (self._labelled(), named_axes(self._label, self._horizontal)):
            return
        if self._is_geographic and elsewhere is not None:
            option = f"urn:ogc:def:crs:EPSG::{self._horizontal.to_epsg()}" if self._expected == "north-east" else "OGC:CRS84"
            numbers += f"; in the order of {self._label[:80]} it would be {find_place(*elsewhere)}: give --crs {option} if that is right"
        elif there:
            numbers += f"{there}: give --axes {other} if that is right"
        yield finding(f"axes-read-as-{words}", 1, numbers)

    def _count_outside(self, points: Points) -> None:
        """Counts points. The label is in doubt only if most of them are outside; a few are strays."""
        if self._box is None:
            return
        self._points += len(points)
        west, south, east, north = self._box
        x, y = (points[:, 1], points[:, 0]) if self._expected == "north-east" else (points[:, 0], points[:, 1])
        outside = (x < west) | (x > east) | (y < south) | (y > north)
        if not outside.any():
            return
        if not self._outside:
            self._describe_outside(points[np.flatnonzero(outside)[0]])
        self._outside += int(outside.sum())

    def _describe_outside(self, point: NDArray[np.float64]) -> None:
        position = self._as_expected(point[:2])
        where = "nowhere on Earth" if position is None else str(find_place(*position))
        is_local = np.abs(point[:2]).max() < LOCAL_M
        self._outside_example = f"{point[0]:.10g} {point[1]:.10g} is {where}"
        self._outside_hint = "; give --crs local for plain metres" if is_local else "; name the right CRS with --crs if this is wrong"


def _nearer_town(places: Places) -> Axes:
    """Returns the order that leads to a town, if the other one leads to none."""
    away = {axes: np.inf if place is None else find_place(*place).distance_km for axes, place in places.items()}
    orders: tuple[Axes, Axes] = ("east-north", "north-east")
    for here, there in (orders, orders[::-1]):
        if away[here] <= NEAR_TOWN_KM and away[there] > max(FAR_FROM_TOWN_KM, TIMES_NEARER * away[here]):
            return here
    return "auto"
