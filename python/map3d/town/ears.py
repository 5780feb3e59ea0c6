"""Cuts polygons with holes into triangles by ear clipping, for formats that know no holes."""

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


def triangles_with_holes(rings: list[Points]) -> list[list[int]]:
    """Triangles as indices into the concatenated rings; the outer ring keeps its direction."""
    points = np.concatenate(rings)
    starts = np.cumsum([0, *(len(r) for r in rings)])
    loops = [list(range(starts[i], starts[i + 1])) for i in range(len(rings))]
    turned = _area(points[loops[0]]) < 0
    loops = [loop if (_area(points[loop]) > 0) == (i == 0) else loop[::-1] for i, loop in enumerate(loops)]
    outer = loops[0]
    for hole in sorted(loops[1:], key=lambda h: -float(points[h, 0].max())):
        outer = _joined(points, outer, hole)
    triangles = _ears(points, outer)
    return [t[::-1] for t in triangles] if turned else triangles


def _area(ring: Points) -> float:
    x, y = ring[:, 0], ring[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _joined(points: Points, outer: list[int], hole: list[int]) -> list[int]:
    """The outer loop with a bridge to the hole's rightmost point, from the nearest point in sight."""
    start = max(range(len(hole)), key=lambda i: (points[hole[i], 0], points[hole[i], 1]))
    target = points[hole[start]]
    order = sorted(range(len(outer)), key=lambda i: float(np.hypot(*(points[outer[i]] - target))))
    edges = [(points[outer[i]], points[outer[(i + 1) % len(outer)]]) for i in range(len(outer))]
    edges += [(points[hole[i]], points[hole[(i + 1) % len(hole)]]) for i in range(len(hole))]
    at = next((i for i in order if not any(_cross(points[outer[i]], target, a, b) for a, b in edges)), order[0])
    return [*outer[: at + 1], *hole[start:], *hole[: start + 1], *outer[at:]]


def _turn(a: Points, b: Points, c: Points) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _cross(p: Points, q: Points, a: Points, b: Points) -> bool:
    """Whether the open segments cross."""
    return _turn(p, q, a) * _turn(p, q, b) < 0 and _turn(a, b, p) * _turn(a, b, q) < 0


def _ears(points: Points, loop: list[int]) -> list[list[int]]:
    loop, triangles = list(loop), []
    while len(loop) > 3:
        ear = next((i for i in range(len(loop)) if _is_ear(points, loop, i)), None)
        if ear is None:
            ear = max(range(len(loop)), key=lambda i: _corner(points, loop, i))
        a, b, c = loop[ear - 1], loop[ear], loop[(ear + 1) % len(loop)]
        if _turn(points[a], points[b], points[c]) > 1e-9:
            triangles.append([a, b, c])
        loop.pop(ear)
    triangles.append(loop)
    return triangles


def _corner(points: Points, loop: list[int], i: int) -> float:
    return _turn(points[loop[i - 1]], points[loop[i]], points[loop[(i + 1) % len(loop)]])


def _is_ear(points: Points, loop: list[int], i: int) -> bool:
    corner = [loop[i - 1], loop[i], loop[(i + 1) % len(loop)]]
    a, b, c = points[corner]
    if _turn(a, b, c) <= 1e-12:
        return False
    others = points[[j for j in loop if not (np.abs(points[j] - points[corner]).sum(axis=1) < 1e-9).any()]]
    if len(others) == 0:
        return True

    def side(p: Points, q: Points) -> Points:
        return np.asarray((q[0] - p[0]) * (others[:, 1] - p[1]) - (q[1] - p[1]) * (others[:, 0] - p[0]))

    return not bool(np.any((side(a, b) >= -1e-9) & (side(b, c) >= -1e-9) & (side(c, a) >= -1e-9)))
