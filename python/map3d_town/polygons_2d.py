"""Functions on polygons in the plane: (n, 2) float64, metres, counter-clockwise and convex unless a function accepts others."""

import math

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
SQUARE = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])


def area(polygon: Points) -> float:
    """Returns the signed area of any simple polygon, positive if counter-clockwise."""
    ahead = _ahead(polygon)
    return float(0.5 * np.sum(polygon[:, 0] * ahead[:, 1] - polygon[:, 1] * ahead[:, 0]))


def _ahead(polygon: Points) -> Points:
    """Returns the successor of each vertex."""
    return np.concatenate([polygon[1:], polygon[:1]])


def unit(vector: Points) -> Points:
    """Returns the vector scaled to length 1."""
    return np.asarray(vector / math.hypot(*vector.tolist()))


def left_normal(vector: Points) -> Points:
    """Returns the vector rotated by 90° counter-clockwise."""
    x, y = vector.tolist()
    return np.array([-y, x])


def without_short_edges(polygon: Points, least_m: float) -> Points:
    """Drops each vertex that is nearer than `least_m` to its predecessor."""
    keep: list[Points] = []
    for point in polygon:
        if not keep or np.hypot(*(point - keep[-1])) >= least_m:
            keep.append(point)
    while len(keep) > 1 and np.hypot(*(keep[0] - keep[-1])) < least_m:
        keep.pop()
    return np.array(keep).reshape(-1, 2)


def clip(polygon: Points, at: Points, inward: Points) -> Points:
    """Returns the part of the polygon where (p - at)·inward >= 0."""
    side = (polygon - at) @ inward
    out: list[Points] = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if side[i] >= 0:
            out.append(polygon[i])
        if (side[i] >= 0) != (side[j] >= 0):
            out.append(polygon[i] + (polygon[j] - polygon[i]) * (side[i] / (side[i] - side[j])))
    return np.array(out).reshape(-1, 2)


def inset(polygon: Points, distance_m: float | Points) -> Points:
    """Moves each edge inward by its distance. The result may have fewer vertices, or none."""
    distances = np.broadcast_to(np.asarray(distance_m, dtype=float), (len(polygon),))
    out = polygon
    for i in range(len(polygon)):
        a, b = polygon[i], polygon[(i + 1) % len(polygon)]
        if np.hypot(*(b - a)) < 1e-9:
            continue
        normal = left_normal(unit(b - a))
        out = clip(out, a + normal * distances[i], normal)
        if len(out) < 3:
            return np.zeros((0, 2))
    out = without_short_edges(out, 0.05)
    return out if len(out) >= 3 and area(out) > 1 else np.zeros((0, 2))


def offset(polygon: Points, distance_m: float) -> Points:
    """Moves all edges inward (outward if negative) and keeps the order of the vertices; see `keeps_its_edges`."""
    forward = _ahead(polygon) - polygon
    forward = forward / np.hypot(forward[:, 0], forward[:, 1])[:, None]
    back = np.concatenate([forward[-1:], forward[:-1]])
    normal, before = (np.stack([-d[:, 1], d[:, 0]], axis=1) for d in (forward, back))
    shared = 1 + np.sum(normal * before, axis=1)
    return np.asarray(polygon + (normal + before) * (distance_m / shared)[:, None])


def keeps_its_edges(polygon: Points, moved: Points, least_m: float) -> bool:
    """Returns whether each edge of `moved = offset(polygon, …)` keeps its direction and is at least `least_m` long."""
    before, after = (_ahead(p) - p for p in (polygon, moved))
    lengths = np.hypot(before[:, 0], before[:, 1])
    return bool(np.all(np.sum(before * after, axis=1) / lengths >= least_m))


def contains(polygon: Points, points: Points, margin_m: float = 0.0) -> NDArray[np.bool_]:
    """Returns a mask of the points inside the polygon and at least `margin_m` from its edges."""
    edge = _ahead(polygon) - polygon
    edge /= np.hypot(edge[:, 0], edge[:, 1])[:, None]
    away = points[:, None] - polygon
    return np.asarray((away[..., 1] * edge[:, 0] - away[..., 0] * edge[:, 1] >= margin_m).all(axis=1))


def rectangle(centre: Points, along: Points, length_m: float, width_m: float) -> Points:
    """Returns a rectangle; its first edge runs along the unit vector `along`, to the right of the centre."""
    return np.asarray(centre + SQUARE @ np.array([along * (length_m / 2), left_normal(along) * (width_m / 2)]))


def circle(centre: Points, radius_m: float, corners: int, start_rad: float = 0.0) -> Points:
    """Returns a regular polygon."""
    angle = start_rad + np.arange(corners) * (2 * np.pi / corners)
    return np.asarray(centre + radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def band(line: Points, width_m: float) -> list[Points]:
    """Returns a quadrilateral of width `width_m` for each segment of a polyline."""
    a, b = line[:-1], line[1:]
    length = np.hypot(*(b - a).T)
    a, b, length = a[length >= 1e-6], b[length >= 1e-6], length[length >= 1e-6]
    step = (b - a) / length[:, None] * (width_m / 2)
    side = np.stack([-step[:, 1], step[:, 0]], axis=1)
    return list(np.stack([a - side, b - side, b + side, a + side], axis=1))


def split(polygon: Points, at: Points, normal: Points) -> tuple[Points, Points]:
    """Returns the parts in front of and behind the line through `at`."""
    return clip(polygon, at, normal), clip(polygon, at, -normal)
