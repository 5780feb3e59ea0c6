"""Cuts polygons with holes into triangles by ear clipping, for formats that know no holes."""

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
# moves points by less than any drawing shows, so that no three lie on a line; triangles without area are left out
JITTER = 1e-5


def triangles_with_holes(rings: list[Points]) -> list[list[int]]:
    """Triangles as indices into the concatenated rings; the outer ring keeps its direction."""
    real = np.concatenate(rings)
    points = real + JITTER * np.random.default_rng(5).uniform(-1, 1, real.shape)
    starts = np.cumsum([0, *(len(r) for r in rings)])
    loops = [list(range(starts[i], starts[i + 1])) for i in range(len(rings))]
    turned = _area(points[loops[0]]) < 0
    loops = [loop if (_area(points[loop]) > 0) == (i == 0) else loop[::-1] for i, loop in enumerate(loops)]
    outer = loops[0]
    for hole in sorted(loops[1:], key=lambda h: -float(points[h, 0].max())):
        outer = _joined(points, outer, hole, loops)
    triangles = [t for t in _ears(points, outer) if abs(_turn(*real[t])) > 1e-7]
    return [t[::-1] for t in triangles] if turned else triangles


def _area(ring: Points) -> float:
    x, y = ring[:, 0], ring[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _joined(points: Points, outer: list[int], hole: list[int], loops: list[list[int]]) -> list[int]:
    """The outer loop with a bridge to the hole's rightmost point, from the nearest point in sight."""
    start = max(range(len(hole)), key=lambda i: (points[hole[i], 0], points[hole[i], 1]))
    target = points[hole[start]]
    order = sorted(range(len(outer)), key=lambda i: float(np.hypot(*(points[outer[i]] - target))))
    edges = [(points[outer[i]], points[outer[(i + 1) % len(outer)]]) for i in range(len(outer))]
    edges += [(points[loop[i - 1]], points[loop[i]]) for loop in loops[1:] for i in range(len(loop))]
    seen = (i for i in order if _opens(points, outer, i, target) and not any(_cross(points[outer[i]], target, a, b) for a, b in edges))
    at = next(seen, order[0])
    return [*outer[: at + 1], *hole[start:], *hole[: start + 1], *outer[at:]]


def _opens(points: Points, loop: list[int], i: int, target: Points) -> bool:
    """Whether the target lies in the inner angle of corner i; a corner may be in the loop several times, with an angle each."""
    before, here, after = (points[loop[j]] for j in (i - 1, i, (i + 1) % len(loop)))
    sides = (_turn(before, here, target) > 0, _turn(here, after, target) > 0)
    return all(sides) if _turn(before, here, after) > 0 else any(sides)


def _turn(a: Points, b: Points, c: Points) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _cross(p: Points, q: Points, a: Points, b: Points) -> bool:
    """Whether the open segments cross."""
    return _turn(p, q, a) * _turn(p, q, b) < 0 and _turn(a, b, p) * _turn(a, b, q) < 0


def _ears(points: Points, loop: list[int]) -> list[list[int]]:
    """Cuts ears off, going round; corners without area are dropped, and where no ear is left the widest corner goes."""
    triangles, at, failed = [], 0, 0
    while len(loop) > 3:
        at %= len(loop)
        corner = [loop[at - 1], loop[at], loop[(at + 1) % len(loop)]]
        turn = _turn(*points[corner])
        empty = abs(turn) <= 1e-9
        if failed > len(loop):
            at = max(range(len(loop)), key=lambda i: _turn(points[loop[i - 1]], points[loop[i]], points[loop[(i + 1) % len(loop)]]))
            corner, empty = [loop[at - 1], loop[at], loop[(at + 1) % len(loop)]], False
        elif not empty and (turn < 0 or not _is_ear(points, loop, corner)):
            at, failed = at + 1, failed + 1
            continue
        if not empty:
            triangles.append(corner)
        loop, at, failed = loop[:at] + loop[at + 1 :], at + (not empty), 0
    if abs(_turn(*points[loop])) > 1e-9:
        triangles.append(loop)
    return triangles


def _is_ear(points: Points, loop: list[int], corner: list[int]) -> bool:
    """Whether no other corner lies in the triangle or on its rim."""
    (ax, ay), (bx, by), (cx, cy) = points[corner].tolist()
    others = points[[i for i in loop if i not in corner]]
    x, y = others[:, 0], others[:, 1]
    inside = (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= -1e-9
    inside &= (cx - bx) * (y - by) - (cy - by) * (x - bx) >= -1e-9
    inside &= (ax - cx) * (y - cy) - (ay - cy) * (x - cx) >= -1e-9
    return not bool(inside.any())
