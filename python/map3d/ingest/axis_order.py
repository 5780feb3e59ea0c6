"""Evidence of the order of the two horizontal axes in a file: its words, its right angles, and the sides to which its surfaces face."""

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from map3d.geometry.crs import horizontal_crs
from map3d.geometry.crs_names import is_description
from map3d.ingest.document_sample import Ring
from map3d.requests.reading import Axes

Points = NDArray[np.float64]
"""(n, 3), in the file's order of axes."""

MAX_EDGE_M: Final = 100.0
RIGHT_ANGLE_COS: Final = 0.02
MIN_RIGHT_ANGLES: Final = 8
METRES_PER_DEGREE: Final = 111_320.0

MIN_FACES: Final = 18
"""Surfaces of three boxes: a single house tells nothing, since some are modelled inside out."""
AGREEING: Final = 0.8
"""Share by which the surfaces that face one way must exceed the others."""
OPEN: Final = 0.01
"""Greatest sum of the area vectors of a closed body, as a part of its area."""
LEAST_VOLUME: Final = 1e-3
"""Least volume that has a sign, as a part of that of the cube whose face is the area of the body."""

_EAST: Final = frozenset({"e", "east", "easting", "lon", "long", "longitude", "rechtswert", "ostwert"})
_NORTH: Final = frozenset({"n", "north", "northing", "lat", "latitude", "hochwert", "nordwert"})
_BY_AUTHORITY: Final = ("urn:ogc:def:crs", "http://www.opengis.net/def/crs", "https://www.opengis.net/def/crs")


def is_north_first(horizontal: CRS) -> bool:
    """Whether the authority puts the northing or the latitude first."""
    return bool(horizontal.axis_info[0].direction == "north")


def labelled_axes(labels: str) -> Axes:
    """Reads `axisLabels` of GML; "auto" where they do not tell, as "x y z", which mean either."""
    words = labels.lower().replace(",", " ").split()
    if len(words) < 2:
        return "auto"
    if words[0] in _EAST and words[1] in _NORTH:
        return "east-north"
    return "north-east" if words[0] in _NORTH and words[1] in _EAST else "auto"


def named_axes(name: str, horizontal: CRS) -> Axes:
    """Returns the authority's order if the name is of a form that means it, a URN or the address of a definition; that of a description."""
    if is_description(name):
        return "north-east" if is_north_first(horizontal_crs(CRS.from_user_input(name))) else "east-north"
    if not name.strip().lower().startswith(_BY_AUTHORITY):
        return "auto"
    return "north-east" if is_north_first(horizontal) else "east-north"


def right_angled_axes(points: Points) -> Axes:
    """Decides degrees: a degree of longitude is shorter than one of latitude, so that with swapped axes rectangles become oblique, except those
    along the axes. `points`: consecutive ones are corners of a building."""
    right = []
    for lon, lat in ((0, 1), (1, 0)):
        scale = METRES_PER_DEGREE * np.cos(np.radians(np.median(points[:, lat])))
        right.append(_right_corners(np.column_stack([points[:, lon] * scale, points[:, lat] * METRES_PER_DEGREE, points[:, 2]])))
    east, north = int((right[0] & ~right[1]).sum()), int((right[1] & ~right[0]).sum())
    if max(east, north) < MIN_RIGHT_ANGLES or max(east, north) < 4 * min(east, north):
        return "auto"
    return "east-north" if east > north else "north-east"


def facing_axes(rings: Sequence[Ring], horizontal: CRS) -> Axes:
    """Decides by closed bodies, whose surfaces face outwards, and by roofs, which face up, and ground, which faces down: in a mirrored reading they
    face the other way."""
    scale = METRES_PER_DEGREE if horizontal.is_geographic else 1.0
    votes = [(vote, len(body)) for body in _bodies(rings) if (vote := _facing(body, scale))]
    faces, upright = sum(count for _, count in votes), sum(vote * count for vote, count in votes)
    if faces < MIN_FACES or abs(upright) < AGREEING * faces:
        return "auto"
    return "east-north" if upright > 0 else "north-east"


def _bodies(rings: Iterable[Ring]) -> Iterable[list[Ring]]:
    found: dict[int, list[Ring]] = {}
    for ring in rings:
        found.setdefault(ring.member, []).append(ring)
    return found.values()


def _facing(body: Sequence[Ring], scale: float) -> int:
    """Returns 1 if the surfaces of a city object face as they should with x to the east, -1 if they face the other way, 0 if undecided."""
    start = body[0].points[0]
    parts = [(ring.points - start) * [scale, scale, 1.0] for ring in body]
    areas = np.array([_area_vector(points) for points in parts])
    total = float(np.linalg.norm(areas, axis=1).sum())
    if not np.isfinite(total) or total <= 0.0:
        return 0
    if float(np.linalg.norm(areas.sum(axis=0))) <= OPEN * total:
        volume = float(sum(points[0] @ area for points, area in zip(parts, areas, strict=True)) / 3.0)
        return 0 if abs(volume) < LEAST_VOLUME * total**1.5 else 1 if volume > 0.0 else -1
    up = {"RoofSurface": 1.0, "GroundSurface": -1.0}
    sides = [up[ring.surface] * area[2] for ring, area in zip(body, areas, strict=True) if ring.surface]
    upright, all_of = sum(sides), sum(map(abs, sides))
    return 0 if not all_of or abs(upright) < AGREEING * all_of else 1 if upright > 0.0 else -1


def _area_vector(points: Points) -> NDArray[np.float64]:
    """Returns half the sum of the cross products of consecutive corners: the area, along the normal."""
    area: NDArray[np.float64] = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0) / 2.0
    return area


def _right_corners(points: Points) -> NDArray[np.bool_]:
    """Returns, for each three consecutive points, whether they form a level right angle with sides of the length of walls."""
    before, after = points[:-2] - points[1:-1], points[2:] - points[1:-1]
    lengths = np.stack([np.hypot(side[:, 0], side[:, 1]) for side in (before, after)])
    level = (np.abs(np.stack([before[:, 2], after[:, 2]])) <= 0.01 * lengths).all(axis=0) & ((lengths > 1.0) & (lengths < MAX_EDGE_M)).all(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.abs((before[:, :2] * after[:, :2]).sum(axis=1)) / lengths.prod(axis=0)
    right: NDArray[np.bool_] = level & (cosine < RIGHT_ANGLE_COS)
    return right
