"""Tessellates Newell's teapot into three closed bodies, pot with lid, handle and spout, with z up."""

import json
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Indices = NDArray[np.int64]
CONTROL = Path(__file__).with_name("teapot.json")
BODIES = (("rim", "body", "lid", "bottom"), ("handle",), ("spout",))
# Factors of x and y of the copies of a patch, by value of "mirror".
MIRRORS = {"xy": ((1, 1), (-1, 1), (-1, -1), (1, -1)), "y": ((1, 1), (1, -1))}


@dataclass(frozen=True)
class ClosedMesh:
    """A closed mesh: points (n, 3); triangles (m, 3), counter-clockwise from outside; unit normals per corner (m, 3, 3)."""

    points: Points
    triangles: Indices
    normals: Points


def teapot(scale: float, steps: int) -> ClosedMesh:
    """Returns the teapot on z = 0 around the z axis; `steps`: number of quadrilaterals along each side of a patch."""
    data = json.loads(CONTROL.read_text())
    bodies = [_body(data, names, steps) for names in BODIES]
    starts = np.cumsum([0, *(len(b.points) for b in bodies)])
    points = np.concatenate([b.points for b in bodies])
    points[:, 2] -= points[:, 2].min()
    triangles = np.concatenate([b.triangles + s for b, s in zip(bodies, starts, strict=False)])
    return ClosedMesh(points * scale, triangles, np.concatenate([b.normals for b in bodies]))


def _body(data: dict, names: tuple[str, ...], steps: int) -> ClosedMesh:  # type: ignore[type-arg]
    """Tessellates the patches of a body with their mirrored copies, welds and closes them."""
    control = np.array(data["points"])
    points: list[Points] = []
    triangles: list[Indices] = []
    count = 0
    for name in names:
        for patch in data["patches"][name]:
            surface = bezier(control[patch].reshape(4, 4, 3), steps)
            for x, y in MIRRORS[data["mirror"][name]]:
                points.append(surface.reshape(-1, 3) * [x, y, 1])
                cells = grid_triangles(steps) + count
                count += len(points[-1])
                triangles.append(cells[:, ::-1] if x * y < 0 else cells)
    welded, faces = weld_points(np.concatenate(points), np.concatenate(triangles))
    shared = len(faces)
    welded, faces = close_holes(welded, faces)
    if signed_volume(welded, faces) < 0:
        faces = faces[:, ::-1]
    return ClosedMesh(welded, faces, corner_normals(welded, faces, shared))


def bezier(control: Points, steps: int) -> Points:
    """Returns (steps + 1, steps + 1, 3) points of a bicubic patch."""
    t = np.linspace(0, 1, steps + 1)
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    return np.asarray(np.einsum("ui,vj,ijk->uvk", weights, weights, control))


def grid_triangles(steps: int) -> Indices:
    """Returns two triangles for each cell of a grid of (steps + 1)² points."""
    i, j = np.meshgrid(np.arange(steps), np.arange(steps), indexing="ij")
    a = (i * (steps + 1) + j).ravel()
    b, c, d = a + 1, a + steps + 2, a + steps + 1
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def weld_points(points: Points, triangles: Indices) -> tuple[Points, Indices]:
    """Merges points that are equal within 1e-6, and drops degenerate triangles."""
    keys = np.round(points * 1e6).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[triangles]
    whole = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return points[first], faces[whole]


def find_open_loops(triangles: Indices) -> list[list[int]]:
    """Returns the loops of edges of only one triangle, in the direction of the missing neighbour."""
    edges = {(int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)}
    follow = {b: a for a, b in edges if (b, a) not in edges}
    loops = []
    while follow:
        loop = [min(follow)]
        while (ahead := follow.pop(loop[-1])) != loop[0]:
            loop.append(ahead)
        loops.append(loop)
    return loops


def close_holes(points: Points, triangles: Indices) -> tuple[Points, Indices]:
    """Bridges the gap between lid and rim, and caps every other open end with a fan around its centre."""
    extra: list[list[int]] = []
    loops = find_open_loops(triangles)
    if len(loops) == 2 and len(loops[0]) == len(loops[1]) and np.ptp(points[[*loops[0], *loops[1]]][:, 2]) < 1e-6:
        extra, loops = bridge_loops(points, *loops), []
    for loop in loops:
        points = np.concatenate([points, points[loop].mean(axis=0)[None]])
        extra += [[loop[i], loop[(i + 1) % len(loop)], len(points) - 1] for i in range(len(loop))]
    return points, np.concatenate([triangles, np.array(extra, dtype=np.int64).reshape(-1, 3)])


def bridge_loops(points: Points, a: list[int], b: list[int]) -> list[list[int]]:
    """Returns triangles between two loops of opposite directions, starting where they are nearest."""
    b = b[::-1]
    start = int(np.argmin(np.hypot(*(points[b] - points[a[0]])[:, :2].T)))
    b = b[start:] + b[:start]
    n, out = len(a), []
    for i in range(n):
        j = (i + 1) % n
        out += [[a[i], a[j], b[j]], [a[i], b[j], b[i]]]
    return out


def signed_volume(points: Points, triangles: Indices) -> float:
    """Returns the signed volume, positive if the triangles are counter-clockwise seen from outside."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


def corner_normals(points: Points, triangles: Indices, shared: int) -> Points:
    """Returns area-weighted smooth normals for the first `shared` triangles, and flat normals for the rest (caps and bridges)."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    total: dict[int, Points] = defaultdict(lambda: np.zeros(3))
    for triangle, normal in zip(triangles[:shared], flat[:shared], strict=True):
        for corner in triangle:
            total[int(corner)] = total[int(corner)] + normal
    normals = np.repeat(flat[:, None, :], 3, axis=1)
    for i, triangle in enumerate(triangles[:shared]):
        normals[i] = [total[int(corner)] for corner in triangle]
    return np.asarray(normals / np.linalg.norm(normals, axis=2, keepdims=True))
