"""The closed shell of a part: walls, roof and ground polygons whose edges all meet, and the eaves beyond it."""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from map3d_town.model import GROUND, ROOF, WALL, Body, Face, Opening, Paint, Part, Plain, Surface, Wrap

Points = NDArray[np.float64]
Outline = list[tuple[float, float]]
Vector = tuple[float, float, float]
DECIMALS = 4
EAVES_THICK_M = 0.16
VERGE_M = 0.28
REVEAL_M = 0.16
MARGIN_M = 0.1
AWAY = np.array([(0.0, -0.06), (0.06, 0.0), (0.0, 0.06), (-0.06, 0.0)])
NEXT = [1, 2, 3, 0]


class Dress(Protocol):
    """What a shell asks for the looks of its surfaces."""

    deep_openings: bool

    def wall(self, side: str, width_m: float, outline: Outline, foot_m: float) -> Paint | Wrap | Plain:
        """The paint of a wall whose upper edge is `outline` [(s, z)], `foot_m` the height of the ground above its foot."""

    def roof(self, width_m: float, height_m: float, slope: float) -> Paint | Wrap | Plain:
        """The paint of a roof polygon; slope = rise over run."""

    def eaves(self) -> Plain:
        """The material below and at the edge of the eaves."""

    def opening(self, opening: Opening) -> Paint | None:
        """None: an opening shows the wall's own paint."""


class Frame:
    """The points of a part: `at(k, i)` is where profile point i crosses side line k; `foot(k, back)` the wall's foot."""

    def __init__(self, part: Part, base_z: float, ground_z: float) -> None:
        self.part, self.base_z, self.eave_z = part, base_z, ground_z + part.eave_m
        front, back = np.asarray(part.front, dtype=float), snapped(np.asarray(part.back, dtype=float))
        t = np.array([p[0] for p in part.profile])
        h = np.array([p[1] for p in part.profile]) + self.eave_z
        plan = front[:, None] + (back - front)[:, None] * t[None, :, None]
        self.points = np.round(np.dstack([plan, np.broadcast_to(h, plan.shape[:2])]), DECIMALS)
        self.strips = len(front) if part.closed else len(front) - 1
        self.depth_m = depth_of(front, back, part.closed)

    def at(self, k: int, i: int) -> Points:
        return np.asarray(self.points[k % len(self.points), i])

    def foot(self, k: int, i: int) -> Points:
        x, y, _ = self.at(k, i)
        return np.array([x, y, round(self.base_z, DECIMALS)])

    @property
    def last(self) -> int:
        return int(self.points.shape[1]) - 1

    @property
    def narrows_to_nothing(self) -> bool:
        """Whether the back is a point or a line, as under a hipped roof."""
        x, y = self.points[:, -1, 0], self.points[:, -1, 1]
        return self.part.closed and abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) < 1e-2


def snapped(points: Points) -> Points:
    """The points, each one that is nearer than 5 mm to an earlier one moved onto it."""
    out = points.copy()
    for k in range(1, len(out)):
        near = np.flatnonzero(np.abs(out[:k] - out[k]).max(axis=1) < 5e-3)
        if len(near):
            out[k] = out[near[0]]
    return out


def depth_of(front: Points, back: Points, closed: bool) -> float:
    """The distance of the back line from the front line of the longest strip."""
    ahead = np.roll(front, -1, axis=0) if closed else front[1:]
    edges = ahead - front[: len(ahead)]
    k = int(np.argmax(np.hypot(edges[:, 0], edges[:, 1])))
    e = edges[k] / np.hypot(*edges[k])
    d = back[k] - front[k]
    return abs(float(e[0] * d[1] - e[1] * d[0]))


def build_shell(part: Part, base_z: float, ground_z: float, dress: Dress) -> Body:
    """The body of a part that stands on `base_z`, with the storeys counted from `ground_z`."""
    frame = Frame(part, base_z, ground_z)
    body = Body(shell=[], base_z=base_z, top_z=float(frame.points[:, :, 2].max()))
    body.shell += _front_and_back(frame, ground_z, dress)
    if not part.closed:
        body.shell += _ends(frame, ground_z, dress)
    body.shell += _half_hipped(frame, dress) if part.half_hip_m else _roof(frame, dress)
    if part.closed and not part.hollow and not frame.narrows_to_nothing:
        body.shell.append(_cap(frame, dress))
    body.shell.append(_ground(frame))
    if part.overhang_m > 0 and part.half_hip_m == 0:
        body.beyond += _eaves(frame, dress)
    return body


def wall_surface(loop: list[Points], side: str, foot_m: float, dress: Dress) -> Surface:
    """A wall with the corners `loop`, which begins with the two feet, left and right, seen from outside."""
    ring = np.array(loop)
    origin, along = ring[0], ring[1] - ring[0]
    width = float(np.hypot(along[0], along[1]))
    along = along / width
    s = (ring[:, :2] - origin[:2]) @ along[:2]
    st = np.stack([np.clip(s, 0, width), ring[:, 2] - origin[2]], axis=1)
    outline = [(float(a), float(b)) for a, b in st[:1:-1]]
    paint = dress.wall(side, width, outline, foot_m)
    surface = Surface(WALL, [Face([ring], [st], paint)])
    if dress.deep_openings and isinstance(paint, Paint):
        for opening in paint.openings:
            _pierce(surface, opening, origin, along, dress)
    return surface


def _pierce(surface: Surface, opening: Opening, origin: Points, along: Points, dress: Dress) -> None:
    """Cuts the opening out of the wall, sets its leaf back and closes the gap with four reveals."""
    wall = surface.faces[0]
    a, b = opening.left_m, opening.left_m + opening.width_m
    low, high = opening.low_m, opening.low_m + opening.height_m
    st = np.array([(a, low), (b, low), (b, high), (a, high)])
    inward = np.array([-along[1], along[0], 0.0])
    outer = (origin + np.column_stack([st[:, :1] * along[:2], st[:, 1]])).round(DECIMALS)
    inner = (outer + inward * REVEAL_M).round(DECIMALS)
    wall.rings.append(outer[::-1])
    wall.st.append(st[::-1])
    kind = "Door" if opening.kind in ("door", "gate", "shop_door") else "Window"
    surface.openings.append(Surface(kind, [Face([inner], [st], wall.paint)]))
    grid, strips = np.concatenate([outer, inner]), np.concatenate([st, st + AWAY, st[NEXT] + AWAY])
    surface.faces += [Face([grid[[i, j, j + 4, i + 4]]], [strips[[i, j, i + 8, i + 4]]], wall.paint) for i, j in enumerate(NEXT)]


def _front_and_back(frame: Frame, ground_z: float, dress: Dress) -> list[Surface]:
    part, m = frame.part, frame.last
    foot_m = ground_z - frame.base_z
    walls = []
    for k in range(frame.strips):
        loop = [frame.foot(k, 0), frame.foot(k + 1, 0), frame.at(k + 1, 0), frame.at(k, 0)]
        walls.append(wall_surface(loop, side_of(part, k), foot_m, dress))
    if part.closed and not part.hollow:
        return walls
    for k in range(frame.strips):
        loop = [frame.foot(k + 1, m), frame.foot(k, m), frame.at(k, m), frame.at(k + 1, m)]
        if np.hypot(*(loop[0] - loop[1])[:2]) > 1e-3:
            walls.append(wall_surface(loop, side_of(part, frame.strips + k), foot_m, dress))
    return walls


def side_of(part: Part, index: int) -> str:
    """What stands at the wall of that number, in the order that `Part.sides` documents; "street" when unsaid."""
    return part.sides[index] if index < len(part.sides) else "street"


def _ends(frame: Frame, ground_z: float, dress: Dress) -> list[Surface]:
    part, n, m = frame.part, frame.strips, frame.last
    foot_m = ground_z - frame.base_z
    last, first = _end_outline(frame, n), _end_outline(frame, 0)
    return [
        wall_surface([frame.foot(0, m), frame.foot(0, 0), *first], side_of(part, 2 * n), foot_m, dress),
        wall_surface([frame.foot(n, 0), frame.foot(n, m), *last[::-1]], side_of(part, 2 * n + 1), foot_m, dress),
    ]


def _end_outline(frame: Frame, k: int) -> list[Points]:
    """The points along the top of the end wall at side line k, front to back."""
    if not frame.part.half_hip_m:
        return [frame.at(k, i) for i in range(frame.last + 1)]
    front_cut, back_cut, _ = _half_hip_points(frame, k)
    return [frame.at(k, 0), front_cut, back_cut, frame.at(k, frame.last)]


def _half_hip_points(frame: Frame, k: int) -> tuple[Points, Points, Points]:
    """Where the half hip begins at the front and the back of end k, and where it meets the ridge."""
    rise = frame.part.profile[1][1]
    low = 1 - frame.part.half_hip_m / rise
    eave, ridge, far = frame.at(k, 0), frame.at(k, 1), frame.at(k, 2)
    toward = frame.at(1 - k, 1) - ridge
    inset_m = frame.part.half_hip_m * (frame.depth_m / 2) / rise
    top = ridge + toward / np.hypot(*toward[:2]) * inset_m
    points = (eave + (ridge - eave) * low, far + (ridge - far) * low, top)
    return points[0].round(DECIMALS), points[1].round(DECIMALS), points[2].round(DECIMALS)


def _half_hipped(frame: Frame, dress: Dress) -> list[Surface]:
    a0, c0, r0 = _half_hip_points(frame, 0)
    a1, c1, r1 = _half_hip_points(frame, 1)
    loops = [
        [frame.at(0, 0), frame.at(1, 0), a1, r1, r0, a0],
        [frame.at(1, 2), frame.at(0, 2), c0, r0, r1, c1],
        [a1, c1, r1],
        [c0, a0, r0],
    ]
    return [roof_surface(loop, dress) for loop in loops]


def _roof(frame: Frame, dress: Dress) -> list[Surface]:
    surfaces = []
    for k in range(frame.strips):
        for i in range(frame.last):
            loop = [frame.at(k, i), frame.at(k + 1, i), frame.at(k + 1, i + 1), frame.at(k, i + 1)]
            surface = roof_surface(loop, dress)
            if surface.faces:
                surfaces.append(surface)
    return surfaces


def roof_surface(loop: list[Points], dress: Dress) -> Surface:
    """A roof polygon; the metres of its paint run along its first edge (the eave) and up the slope. Upright: a wall."""
    ring = distinct(loop)
    if len(ring) < 3:
        return Surface(ROOF, [])
    nx, ny, nz = normal = newell(ring)
    along, up = _paint_axes(ring, normal)
    st = (ring - ring[0]) @ np.array([along, up]).T
    st -= st.min(axis=0)
    slope = math.hypot(nx, ny) / max(abs(nz), 1e-9)
    upright = abs(nz) < 1e-6
    width, height = st.max(axis=0).tolist()
    paint = dress.wall("blank", width, [(0.0, height), (width, height)], 0.0) if upright else dress.roof(width, height, slope)
    return Surface(WALL if upright else ROOF, [Face([ring], [st], paint)])


def _paint_axes(ring: Points, normal: Vector) -> tuple[Vector, Vector]:
    """The directions of a roof's paint: along its first edge, or the longest when that is short, kept level; and up the slope."""
    edges = [tuple(step) for step in (np.concatenate([ring[1:], ring[:1]]) - ring).tolist()]
    x, y, z = edges[0] if math.hypot(*edges[0][:2]) > 0.3 else _longest(edges)
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    nx, ny, nz = normal
    if abs(nz) > 1e-6 and abs(z) > 1e-3:
        level = math.hypot(nx, ny)
        x, y, z = -ny / level, nx / level, 0.0
    return (x, y, z), (ny * z - nz * y, nz * x - nx * z, nx * y - ny * x)


def _longest(edges: list[Vector]) -> Vector:
    """The longest edge as seen from above."""
    return max(edges, key=lambda edge: math.hypot(edge[0], edge[1]))


def distinct(loop: list[Points]) -> Points:
    """The ring without points that repeat their predecessor."""
    ring = np.array(loop).reshape(-1, 3)
    moved = np.abs(ring - np.concatenate([ring[-1:], ring[:-1]])).max(axis=1) > 1e-3
    return ring if moved.all() else ring[moved]


def newell(ring: Points) -> Vector:
    """The unit normal of a flat ring."""
    nx = ny = nz = 0.0
    rows = ring.tolist()
    for (ax, ay, az), (bx, by, bz) in zip(rows, rows[1:] + rows[:1], strict=True):
        nx, ny, nz = nx + (ay - by) * (az + bz), ny + (az - bz) * (ax + bx), nz + (ax - bx) * (ay + by)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


def _cap(frame: Frame, dress: Dress) -> Surface:
    return roof_surface([frame.at(k, frame.last) for k in range(frame.strips)], dress)


def _ground(frame: Frame) -> Surface:
    part, n, m = frame.part, frame.strips, frame.last
    if part.closed:
        rings = [distinct([frame.foot(k, 0) for k in range(n)])[::-1]]
        if part.hollow:
            rings.append(np.array([frame.foot(k, m) for k in range(n)]))
    else:
        loop = [frame.foot(k, 0) for k in range(n + 1)] + [frame.foot(k, m) for k in range(n, -1, -1)]
        rings = [distinct(loop)[::-1]]
    return Surface(GROUND, [Face(rings, [ring[:, :2] - rings[0][0, :2] for ring in rings], Plain("ground"))])


def _eaves(frame: Frame, dress: Dress) -> list[Surface]:
    """The roof beyond the walls: a slab on every free side."""
    grid, k0, i0 = _grown(frame)
    k1, i1 = k0 + frame.strips, i0 + frame.last
    inside = {(k, i) for k in range(k0, k1) for i in range(i0, i1)}
    strips = frame.strips if frame.part.closed else len(grid) - 1
    outer = {(k, i) for k in range(strips) for i in range(grid.shape[1] - 1)} - inside
    drop = np.array([0.0, 0.0, EAVES_THICK_M])
    surfaces = []
    for k, i in sorted(outer):
        near, far = grid[k], grid[(k + 1) % len(grid)]
        loop = [near[i], far[i], far[i + 1], near[i + 1]]
        top = roof_surface(loop, dress)
        if not top.faces or top.kind == WALL:
            continue
        surfaces.append(top)
        below = distinct([p - drop for p in loop[::-1]])
        surfaces.append(plain_surface(ROOF, below, dress.eaves()))
        for j, (dk, di) in enumerate([(0, -1), (1, 0), (0, 1), (-1, 0)]):
            beside = ((k + dk) % strips if frame.part.closed else k + dk, i + di)
            if beside not in outer and beside not in inside:
                a, b = loop[j], loop[(j + 1) % 4]
                rim = distinct([a - drop, b - drop, b, a])
                if len(rim) == 4:
                    surfaces.append(plain_surface(ROOF, rim, dress.eaves()))
    return surfaces


def plain_surface(kind: str, ring: Points, material: Plain) -> Surface:
    """A surface without texture."""
    return Surface(kind, [Face([ring], [np.zeros((len(ring), 2))], material)])


def _grown(frame: Frame) -> tuple[Points, int, int]:
    """The grid of profile points with the eaves and verges added, and where the old grid begins in it."""
    part, grid = frame.part, frame.points
    reach = part.overhang_m / (frame.depth_m * max(part.profile[1][0] - part.profile[0][0], 1e-6))
    columns, i0, k0 = [grid], 0, 0
    if part.profile[1][0] > part.profile[0][0]:
        columns.insert(0, (grid[:, :1] + (grid[:, :1] - grid[:, 1:2]) * reach))
        i0 = 1
    open_back = part.hollow or not part.closed
    if open_back and part.profile[-1][0] > part.profile[-2][0] and part.profile[-2][1] > part.profile[-1][1]:
        run = frame.depth_m * (part.profile[-1][0] - part.profile[-2][0])
        columns.append(grid[:, -1:] + (grid[:, -1:] - grid[:, -2:-1]) * (part.overhang_m / run))
    grown = np.concatenate(columns, axis=1)
    if not part.closed:
        n = frame.strips
        before, after = (side_of(part, 2 * n + e) != "party" for e in (0, 1))
        first, last = (_unit_along(grown, a, b) for a, b in ((1, 0), (-2, -1)))
        if before:
            grown, k0 = np.concatenate([grown[:1] + first * VERGE_M, grown]), 1
        if after:
            grown = np.concatenate([grown, grown[-1:] + last * VERGE_M])
    return grown.round(DECIMALS), k0, i0


def _unit_along(grid: Points, a: int, b: int) -> Points:
    """The level direction from side line a to side line b at their front."""
    step = grid[b, 0] - grid[a, 0]
    step[2] = 0
    return np.asarray(step / np.linalg.norm(step))
