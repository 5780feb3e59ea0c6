"""Builds the shell of a building part, closed walls, roof and ground surface, and the eaves outside it."""

import math
from typing import Protocol

import numpy as np

from map3d_town.layout.town_plan import BuildingPart
from map3d_town.models.building_model import (
    GROUND,
    ROOF,
    WALL,
    AtlasTexture,
    BoundarySurface,
    Opening,
    PartGeometry,
    PlainMaterial,
    RepeatingTexture,
    TexturedFace,
)
from map3d_town.polygons_2d import Points

Outline = list[tuple[float, float]]
Vector = tuple[float, float, float]
DECIMALS = 4
EAVES_THICK_M = 0.16
VERGE_M = 0.28
REVEAL_M = 0.16
MARGIN_M = 0.1
REVEAL_ST = np.array([(0.0, -0.06), (0.06, 0.0), (0.0, 0.06), (-0.06, 0.0)])
NEXT = [1, 2, 3, 0]


class FacadeDesign(Protocol):
    """Chooses the materials of the surfaces of a shell."""

    deep_openings: bool

    def wall(self, side: str, width_m: float, outline: Outline, foot_m: float) -> AtlasTexture | RepeatingTexture | PlainMaterial:
        """Returns the material of a wall with the upper edge `outline` [(s, z)]; `foot_m`: height of the ground above the wall's foot."""

    def roof(self, width_m: float, height_m: float, slope: float) -> AtlasTexture | RepeatingTexture | PlainMaterial:
        """Returns the material of a roof face; slope = rise over run."""

    def eaves(self) -> PlainMaterial:
        """Returns the material of underside and edge of the eaves."""

    def opening(self, opening: Opening) -> AtlasTexture | None:
        """None: an opening shows the wall's own paint."""


class PartGrid:
    """The grid of points of a part: `at(k, i)` is profile point i on side line k, `foot(k, i)` the wall's foot below it."""

    def __init__(self, part: BuildingPart, base_z: float, ground_z: float) -> None:
        self.part, self.base_z, self.eave_z = part, base_z, ground_z + part.eave_m
        front, back = np.asarray(part.front, dtype=float), snap_points(np.asarray(part.back, dtype=float))
        t = np.array([p[0] for p in part.profile])
        h = np.array([p[1] for p in part.profile]) + self.eave_z
        plan = front[:, None] + (back - front)[:, None] * t[None, :, None]
        self.points = np.round(np.dstack([plan, np.broadcast_to(h, plan.shape[:2])]), DECIMALS)
        self.strips = len(front) if part.closed else len(front) - 1
        self.depth_m = strip_depth(front, back, part.closed)

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


def snap_points(points: Points) -> Points:
    """Moves each point within 5 mm of an earlier one onto that one."""
    out = points.copy()
    for k in range(1, len(out)):
        near = np.flatnonzero(np.abs(out[:k] - out[k]).max(axis=1) < 5e-3)
        if len(near):
            out[k] = out[near[0]]
    return out


def strip_depth(front: Points, back: Points, closed: bool) -> float:
    """Returns the distance between front and back of the longest strip."""
    ahead = np.roll(front, -1, axis=0) if closed else front[1:]
    edges = ahead - front[: len(ahead)]
    k = int(np.argmax(np.hypot(edges[:, 0], edges[:, 1])))
    e = edges[k] / np.hypot(*edges[k])
    d = back[k] - front[k]
    return abs(float(e[0] * d[1] - e[1] * d[0]))


def build_shell(part: BuildingPart, base_z: float, ground_z: float, design: FacadeDesign) -> PartGeometry:
    """Returns the geometry of a part with its base at `base_z` and its storeys counted from `ground_z`."""
    part_grid = PartGrid(part, base_z, ground_z)
    body = PartGeometry(shell=[], base_z=base_z, top_z=float(part_grid.points[:, :, 2].max()))
    body.shell += _make_long_walls(part_grid, ground_z, design)
    if not part.closed:
        body.shell += _make_end_walls(part_grid, ground_z, design)
    body.shell += _make_half_hipped_roof(part_grid, design) if part.half_hip_m else _make_roof_strips(part_grid, design)
    if part.closed and not part.hollow and not part_grid.narrows_to_nothing:
        body.shell.append(_make_cap(part_grid, design))
    body.shell.append(_make_ground(part_grid))
    if part.overhang_m > 0 and part.half_hip_m == 0:
        body.overhangs += _make_eaves(part_grid, design)
    return body


def make_wall(loop: list[Points], side: str, foot_m: float, design: FacadeDesign) -> BoundarySurface:
    """Returns a wall with the corners `loop`, which starts with the left and right foot, seen from outside."""
    ring = np.array(loop)
    origin, along = ring[0], ring[1] - ring[0]
    width = float(np.hypot(along[0], along[1]))
    along = along / width
    s = (ring[:, :2] - origin[:2]) @ along[:2]
    st = np.stack([np.clip(s, 0, width), ring[:, 2] - origin[2]], axis=1)
    outline = [(float(a), float(b)) for a, b in st[:1:-1]]
    material = design.wall(side, width, outline, foot_m)
    surface = BoundarySurface(WALL, [TexturedFace([ring], [st], material)])
    if design.deep_openings and isinstance(material, AtlasTexture):
        for opening in material.openings:
            _cut_opening(surface, opening, origin, along, design)
    return surface


def _cut_opening(surface: BoundarySurface, opening: Opening, origin: Points, along: Points, design: FacadeDesign) -> None:
    """Cuts the opening out of the wall, recesses its face and adds four reveals."""
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
    surface.openings.append(BoundarySurface(kind, [TexturedFace([inner], [st], wall.material)]))
    grid, strips = np.concatenate([outer, inner]), np.concatenate([st, st + REVEAL_ST, st[NEXT] + REVEAL_ST])
    surface.faces += [TexturedFace([grid[[i, j, j + 4, i + 4]]], [strips[[i, j, i + 8, i + 4]]], wall.material) for i, j in enumerate(NEXT)]


def _make_long_walls(part_grid: PartGrid, ground_z: float, design: FacadeDesign) -> list[BoundarySurface]:
    part, m = part_grid.part, part_grid.last
    foot_m = ground_z - part_grid.base_z
    walls = []
    for k in range(part_grid.strips):
        loop = [part_grid.foot(k, 0), part_grid.foot(k + 1, 0), part_grid.at(k + 1, 0), part_grid.at(k, 0)]
        walls.append(make_wall(loop, side_of_wall(part, k), foot_m, design))
    if part.closed and not part.hollow:
        return walls
    for k in range(part_grid.strips):
        loop = [part_grid.foot(k + 1, m), part_grid.foot(k, m), part_grid.at(k, m), part_grid.at(k + 1, m)]
        if np.hypot(*(loop[0] - loop[1])[:2]) > 1e-3:
            walls.append(make_wall(loop, side_of_wall(part, part_grid.strips + k), foot_m, design))
    return walls


def side_of_wall(part: BuildingPart, index: int) -> str:
    """Returns the side of wall number `index` in the order of `BuildingPart.sides`; the default is "street"."""
    return part.sides[index] if index < len(part.sides) else "street"


def _make_end_walls(part_grid: PartGrid, ground_z: float, design: FacadeDesign) -> list[BoundarySurface]:
    part, n, m = part_grid.part, part_grid.strips, part_grid.last
    foot_m = ground_z - part_grid.base_z
    last, first = _end_outline(part_grid, n), _end_outline(part_grid, 0)
    return [
        make_wall([part_grid.foot(0, m), part_grid.foot(0, 0), *first], side_of_wall(part, 2 * n), foot_m, design),
        make_wall([part_grid.foot(n, 0), part_grid.foot(n, m), *last[::-1]], side_of_wall(part, 2 * n + 1), foot_m, design),
    ]


def _end_outline(part_grid: PartGrid, k: int) -> list[Points]:
    """Returns the points along the top of the end wall at side line k, front to back."""
    if not part_grid.part.half_hip_m:
        return [part_grid.at(k, i) for i in range(part_grid.last + 1)]
    front_cut, back_cut, _ = _half_hip_points(part_grid, k)
    return [part_grid.at(k, 0), front_cut, back_cut, part_grid.at(k, part_grid.last)]


def _half_hip_points(part_grid: PartGrid, k: int) -> tuple[Points, Points, Points]:
    """Returns the points where the half hip at end k starts at the front and at the back, and where it joins the ridge."""
    rise = part_grid.part.profile[1][1]
    low = 1 - part_grid.part.half_hip_m / rise
    eave, ridge, far = part_grid.at(k, 0), part_grid.at(k, 1), part_grid.at(k, 2)
    toward = part_grid.at(1 - k, 1) - ridge
    inset_m = part_grid.part.half_hip_m * (part_grid.depth_m / 2) / rise
    top = ridge + toward / np.hypot(*toward[:2]) * inset_m
    points = (eave + (ridge - eave) * low, far + (ridge - far) * low, top)
    return points[0].round(DECIMALS), points[1].round(DECIMALS), points[2].round(DECIMALS)


def _make_half_hipped_roof(part_grid: PartGrid, design: FacadeDesign) -> list[BoundarySurface]:
    a0, c0, r0 = _half_hip_points(part_grid, 0)
    a1, c1, r1 = _half_hip_points(part_grid, 1)
    loops = [
        [part_grid.at(0, 0), part_grid.at(1, 0), a1, r1, r0, a0],
        [part_grid.at(1, 2), part_grid.at(0, 2), c0, r0, r1, c1],
        [a1, c1, r1],
        [c0, a0, r0],
    ]
    return [make_roof(loop, design) for loop in loops]


def _make_roof_strips(part_grid: PartGrid, design: FacadeDesign) -> list[BoundarySurface]:
    surfaces = []
    for k in range(part_grid.strips):
        for i in range(part_grid.last):
            loop = [part_grid.at(k, i), part_grid.at(k + 1, i), part_grid.at(k + 1, i + 1), part_grid.at(k, i + 1)]
            surface = make_roof(loop, design)
            if surface.faces:
                surfaces.append(surface)
    return surfaces


def make_roof(loop: list[Points], design: FacadeDesign) -> BoundarySurface:
    """Returns a roof surface, textured along its first edge (the eave) and up the slope. A vertical one becomes a wall."""
    ring = drop_repeated_points(loop)
    if len(ring) < 3:
        return BoundarySurface(ROOF, [])
    nx, ny, nz = normal = unit_normal(ring)
    along, up = _texture_axes(ring, normal)
    st = (ring - ring[0]) @ np.array([along, up]).T
    st -= st.min(axis=0)
    slope = math.hypot(nx, ny) / max(abs(nz), 1e-9)
    upright = abs(nz) < 1e-6
    width, height = st.max(axis=0).tolist()
    material = design.wall("blank", width, [(0.0, height), (width, height)], 0.0) if upright else design.roof(width, height, slope)
    return BoundarySurface(WALL if upright else ROOF, [TexturedFace([ring], [st], material)])


def _texture_axes(ring: Points, normal: Vector) -> tuple[Vector, Vector]:
    """Returns the texture axes of a roof: level along its first edge, or its longest if that is short; and up the slope."""
    edges = [tuple(step) for step in (np.concatenate([ring[1:], ring[:1]]) - ring).tolist()]
    x, y, z = edges[0] if math.hypot(*edges[0][:2]) > 0.3 else _longest_edge(edges)
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    nx, ny, nz = normal
    if abs(nz) > 1e-6 and abs(z) > 1e-3:
        level = math.hypot(nx, ny)
        x, y, z = -ny / level, nx / level, 0.0
    return (x, y, z), (ny * z - nz * y, nz * x - nx * z, nx * y - ny * x)


def _longest_edge(edges: list[Vector]) -> Vector:
    """Returns the edge that is longest seen from above."""
    return max(edges, key=lambda edge: math.hypot(edge[0], edge[1]))


def drop_repeated_points(loop: list[Points]) -> Points:
    """Drops points that repeat their predecessor."""
    ring = np.array(loop).reshape(-1, 3)
    moved = np.abs(ring - np.concatenate([ring[-1:], ring[:-1]])).max(axis=1) > 1e-3
    return ring if moved.all() else ring[moved]


def unit_normal(ring: Points) -> Vector:
    """Returns the unit normal of a flat ring, after Newell."""
    nx = ny = nz = 0.0
    rows = ring.tolist()
    for (ax, ay, az), (bx, by, bz) in zip(rows, rows[1:] + rows[:1], strict=True):
        nx, ny, nz = nx + (ay - by) * (az + bz), ny + (az - bz) * (ax + bx), nz + (ax - bx) * (ay + by)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


def _make_cap(part_grid: PartGrid, design: FacadeDesign) -> BoundarySurface:
    return make_roof([part_grid.at(k, part_grid.last) for k in range(part_grid.strips)], design)


def _make_ground(part_grid: PartGrid) -> BoundarySurface:
    part, n, m = part_grid.part, part_grid.strips, part_grid.last
    if part.closed:
        rings = [drop_repeated_points([part_grid.foot(k, 0) for k in range(n)])[::-1]]
        if part.hollow:
            rings.append(np.array([part_grid.foot(k, m) for k in range(n)]))
    else:
        loop = [part_grid.foot(k, 0) for k in range(n + 1)] + [part_grid.foot(k, m) for k in range(n, -1, -1)]
        rings = [drop_repeated_points(loop)[::-1]]
    return BoundarySurface(GROUND, [TexturedFace(rings, [ring[:, :2] - rings[0][0, :2] for ring in rings], PlainMaterial("ground"))])


def _make_eaves(part_grid: PartGrid, design: FacadeDesign) -> list[BoundarySurface]:
    """Returns the eaves: a slab along each side without neighbour."""
    grid, k0, i0 = _extend_grid(part_grid)
    k1, i1 = k0 + part_grid.strips, i0 + part_grid.last
    inside = {(k, i) for k in range(k0, k1) for i in range(i0, i1)}
    strips = part_grid.strips if part_grid.part.closed else len(grid) - 1
    outer = {(k, i) for k in range(strips) for i in range(grid.shape[1] - 1)} - inside
    drop = np.array([0.0, 0.0, EAVES_THICK_M])
    surfaces = []
    for k, i in sorted(outer):
        near, far = grid[k], grid[(k + 1) % len(grid)]
        loop = [near[i], far[i], far[i + 1], near[i + 1]]
        top = make_roof(loop, design)
        if not top.faces or top.kind == WALL:
            continue
        surfaces.append(top)
        below = drop_repeated_points([p - drop for p in loop[::-1]])
        surfaces.append(make_untextured(ROOF, below, design.eaves()))
        for j, (dk, di) in enumerate([(0, -1), (1, 0), (0, 1), (-1, 0)]):
            neighbour = ((k + dk) % strips if part_grid.part.closed else k + dk, i + di)
            if neighbour not in outer and neighbour not in inside:
                a, b = loop[j], loop[(j + 1) % 4]
                rim = drop_repeated_points([a - drop, b - drop, b, a])
                if len(rim) == 4:
                    surfaces.append(make_untextured(ROOF, rim, design.eaves()))
    return surfaces


def make_untextured(kind: str, ring: Points, material: PlainMaterial) -> BoundarySurface:
    """Returns an untextured surface of one face."""
    return BoundarySurface(kind, [TexturedFace([ring], [np.zeros((len(ring), 2))], material)])


def _extend_grid(part_grid: PartGrid) -> tuple[Points, int, int]:
    """Returns the grid of points extended by eaves and verges, and the position (k, i) of the original grid in it."""
    part, grid = part_grid.part, part_grid.points
    reach = part.overhang_m / (part_grid.depth_m * max(part.profile[1][0] - part.profile[0][0], 1e-6))
    columns, i0, k0 = [grid], 0, 0
    if part.profile[1][0] > part.profile[0][0]:
        columns.insert(0, (grid[:, :1] + (grid[:, :1] - grid[:, 1:2]) * reach))
        i0 = 1
    open_back = part.hollow or not part.closed
    if open_back and part.profile[-1][0] > part.profile[-2][0] and part.profile[-2][1] > part.profile[-1][1]:
        run = part_grid.depth_m * (part.profile[-1][0] - part.profile[-2][0])
        columns.append(grid[:, -1:] + (grid[:, -1:] - grid[:, -2:-1]) * (part.overhang_m / run))
    grown = np.concatenate(columns, axis=1)
    if not part.closed:
        n = part_grid.strips
        before, after = (side_of_wall(part, 2 * n + e) != "party" for e in (0, 1))
        first, last = (_unit_along(grown, a, b) for a, b in ((1, 0), (-2, -1)))
        if before:
            grown, k0 = np.concatenate([grown[:1] + first * VERGE_M, grown]), 1
        if after:
            grown = np.concatenate([grown, grown[-1:] + last * VERGE_M])
    return grown.round(DECIMALS), k0, i0


def _unit_along(grid: Points, a: int, b: int) -> Points:
    """Returns the horizontal unit vector from side line a to side line b at their front."""
    step = grid[b, 0] - grid[a, 0]
    step[2] = 0
    return np.asarray(step / np.linalg.norm(step))
