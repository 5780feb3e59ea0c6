"""Triangulates polygons with holes by ear clipping, for formats without holes."""

import numpy as np

from map3d_town.polygons_2d import Points

# A shift of points that is too small to see, but keeps any three from being collinear. Triangles without area are dropped.
JITTER = 1e-5


def triangulate_with_holes(rings: list[Points]) -> list[list[int]]:
    """Returns triangles as indices into the concatenated rings, with the orientation of the outer ring."""
    real = np.concatenate(rings)
    points = real + JITTER * np.random.default_rng(5).uniform(-1, 1, real.shape)
    starts = np.cumsum([0, *(len(r) for r in rings)])
    loops = [list(range(starts[i], starts[i + 1])) for i in range(len(rings))]
    turned = _area(points[loops[0]]) < 0
    loops = [loop if (_area(points[loop]) > 0) == (i == 0) else loop[::-1] for i, loop in enumerate(loops)]
    outer = loops[0]
    for hole in sorted(loops[1:], key=lambda h: -float(points[h, 0].max())):
        outer = _bridge_hole(points, outer, hole, loops)
    triangles = [t for t in _clip_ears(points, outer) if abs(_signed_turn(*real[t])) > 1e-7]
    return [t[::-1] for t in triangles] if turned else triangles


def _area(ring: Points) -> float:
    x, y = ring[:, 0], ring[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def _bridge_hole(points: Points, outer: list[int], hole: list[int], loops: list[list[int]]) -> list[int]:
    """Joins a hole to the outer loop by a bridge from its rightmost point to the nearest visible point."""
    start = max(range(len(hole)), key=lambda i: (points[hole[i], 0], points[hole[i], 1]))
    target = points[hole[start]]
    order = sorted(range(len(outer)), key=lambda i: float(np.hypot(*(points[outer[i]] - target))))
    edges = [(points[outer[i]], points[outer[(i + 1) % len(outer)]]) for i in range(len(outer))]
    edges += [(points[loop[i - 1]], points[loop[i]]) for loop in loops[1:] for i in range(len(loop))]
    seen = (
        i
        for i in order
        if _is_in_inner_angle(points, outer, i, target) and not any(_segments_cross(points[outer[i]], target, a, b) for a, b in edges)
    )
    at = next(seen, order[0])
    return [*outer[: at + 1], *hole[start:], *hole[: start + 1], *outer[at:]]


def _is_in_inner_angle(points: Points, loop: list[int], i: int, target: Points) -> bool:
    """Returns whether the target is in the inner angle of corner i. A point may occur in the loop several times, with different angles."""
    before, here, after = (points[loop[j]] for j in (i - 1, i, (i + 1) % len(loop)))
    sides = (_signed_turn(before, here, target) > 0, _signed_turn(here, after, target) > 0)
    return all(sides) if _signed_turn(before, here, after) > 0 else any(sides)


def _signed_turn(a: Points, b: Points, c: Points) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _segments_cross(p: Points, q: Points, a: Points, b: Points) -> bool:
    """Returns whether the open segments cross."""
    return _signed_turn(p, q, a) * _signed_turn(p, q, b) < 0 and _signed_turn(a, b, p) * _signed_turn(a, b, q) < 0


def _clip_ears(points: Points, loop: list[int]) -> list[list[int]]:
    """Clips ears around the loop and drops corners without area. If there is no ear, clips the most convex corner."""
    triangles, at, failed = [], 0, 0
    while len(loop) > 3:
        at %= len(loop)
        corner = [loop[at - 1], loop[at], loop[(at + 1) % len(loop)]]
        turn = _signed_turn(*points[corner])
        empty = abs(turn) <= 1e-9
        if failed > len(loop):
            at = max(range(len(loop)), key=lambda i: _signed_turn(points[loop[i - 1]], points[loop[i]], points[loop[(i + 1) % len(loop)]]))
            corner, empty = [loop[at - 1], loop[at], loop[(at + 1) % len(loop)]], False
        elif not empty and (turn < 0 or not _is_ear(points, loop, corner)):
            at, failed = at + 1, failed + 1
            continue
        if not empty:
            triangles.append(corner)
        loop, at, failed = loop[:at] + loop[at + 1 :], at + (not empty), 0
    if abs(_signed_turn(*points[loop])) > 1e-9:
        triangles.append(loop)
    return triangles


def _is_ear(points: Points, loop: list[int], corner: list[int]) -> bool:
    """Returns whether no other corner is in the triangle or on its edges."""
    (ax, ay), (bx, by), (cx, cy) = points[corner].tolist()
    others = points[[i for i in loop if i not in corner]]
    x, y = others[:, 0], others[:, 1]
    inside = (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= -1e-9
    inside &= (cx - bx) * (y - by) - (cy - by) * (x - bx) >= -1e-9
    inside &= (ax - cx) * (y - cy) - (ay - cy) * (x - cx) >= -1e-9
    return not bool(inside.any())
