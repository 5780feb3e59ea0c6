"""Adds building installations to a shell: dormers, chimneys, columns, balconies, battlements."""

import numpy as np

from map3d_town.layout.town_plan import BuildingPart, BuildingPlan
from map3d_town.models.building_model import (
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
from map3d_town.models.facade_design import TexturedFacadeDesign
from map3d_town.models.part_shell import PartGrid, make_roof, make_untextured, make_wall
from map3d_town.polygons_2d import Points

DORMER, CHIMNEY, BALCONY, COLUMN, BATTLEMENT = "1010", "1020", "1000", "1040", "1070"
Installation = tuple[str, list[BoundarySurface]]


class RoofSlope:
    """A roof slope seen along its eave: `at(s, y, z)` is s metres along, y metres inward, z metres above the slope's foot."""

    def __init__(self, part_grid: PartGrid, k: int, from_back: bool) -> None:
        i, j = (part_grid.last, part_grid.last - 1) if from_back else (0, 1)
        a, b = (k + 1, k) if from_back else (k, k + 1)
        self.origin, end, above = part_grid.at(a, i), part_grid.at(b, i), part_grid.at(a, j)
        self.length_m = float(np.hypot(*(end - self.origin)[:2]))
        self.along = (end - self.origin) / max(self.length_m, 1e-9)
        self.inward = np.array([-self.along[1], self.along[0], 0.0])
        self.run_m = float((above - self.origin) @ self.inward)
        self.rise_m = float(above[2] - self.origin[2])

    @property
    def slope(self) -> float:
        return self.rise_m / max(self.run_m, 1e-9)

    def at(self, s: float, y: float, z: float) -> Points:
        return np.asarray((self.origin + self.along * s + self.inward * y + np.array([0, 0, z])).round(4))


def add_installations(
    body: PartGeometry,
    part: BuildingPart,
    building: BuildingPlan,
    number: int,
    design: TexturedFacadeDesign,
    ground_z: float,
    rng: np.random.Generator,
) -> None:
    """Adds the installations for a part's facade and roof; with part 0 also the planned ones."""
    part_grid = PartGrid(part, body.base_z, ground_z)
    if part.facade_kind in ("house", "timber", "gruender", "villa", "townhall", "row") and part.cover in ("tiles", "dark", "slate"):
        for slope in slopes(part_grid):
            body.installations += dormers(slope, design, rng)
        body.installations += chimneys(part_grid, rng)
    if part.facade_kind == "slab":
        body.installations += balconies(part_grid, part, design)
    if number == 0:
        body.installations += make_planned(building, ground_z)
    for _, surfaces in body.installations:
        body.top_z = max([body.top_z, *(float(f.rings[0][:, 2].max()) for s in surfaces for f in s.faces)])


def slopes(part_grid: PartGrid) -> list[RoofSlope]:
    """Returns the roof slopes that are large enough for dormers and chimneys."""
    part = part_grid.part
    if part.half_hip_m or (len(part.profile) < 3 and not part_grid.narrows_to_nothing):
        return []
    out = [RoofSlope(part_grid, k, False) for k in range(part_grid.strips)]
    if not part.closed:
        out += [RoofSlope(part_grid, k, True) for k in range(part_grid.strips)]
    return [s for s in out if s.length_m > 4.5 and s.run_m > 1.2 and 0.45 < s.slope < 4]


def dormers(slope: RoofSlope, design: TexturedFacadeDesign, rng: np.random.Generator) -> list[Installation]:
    """Returns a row of gabled or flat dormers, or none."""
    chance = 0.65 if design.facade_kind in ("house", "timber", "gruender", "townhall") else 0.3
    if rng.random() > chance:
        return []
    width, height = 1.35, 1.25
    count = int((slope.length_m - 1.2) / rng.uniform(2.8, 4.0))
    gabled = design.facade_kind != "row" and rng.random() < 0.7
    start = 0.5 / max(slope.slope, 0.6)
    top = (height + (0.75 if gabled else 0)) / (slope.slope - 0.0 if gabled else slope.slope - 0.12)
    if slope.slope > 2 or start + top > slope.run_m - 0.15:
        return []
    places = [(i + 0.5) * slope.length_m / count for i in range(count)]
    build_model = gabled_dormer if gabled else flat_dormer
    return [(DORMER, build_model(slope, s - width / 2, start, width, height, design)) for s in places]


def dormer_front(loop: list[Points], design: TexturedFacadeDesign, width: float, height: float) -> BoundarySurface:
    """Returns the front of a dormer: a wall with one window."""
    front = make_wall(loop, "blank", 0.0, design)
    material = front.faces[0].material
    if isinstance(material, AtlasTexture):
        window = Opening("window", 0.2, 0.2, width - 0.4, height - 0.4)
        traits = material.traits - {"shutters", "cornice"} | {"plain"}
        front.faces[0].material = AtlasTexture("facade", material.width_m, material.height_m, material.colors, (window,), (), traits)
    return front


def flat_dormer(slope: RoofSlope, s: float, y: float, width: float, height: float, design: TexturedFacadeDesign) -> list[BoundarySurface]:
    """Returns front, two cheeks and a roof with a slight slope to the front."""
    foot = slope.slope * y
    back = y + height / (slope.slope - 0.12)
    low = [slope.at(s, y, foot), slope.at(s + width, y, foot)]
    high = [slope.at(s + width, y, foot + height), slope.at(s, y, foot + height)]
    rear = [slope.at(s + width, back, slope.slope * back), slope.at(s, back, slope.slope * back)]
    cheek = PlainMaterial("cheek")
    return [
        dormer_front([*low, *high], design, width, height),
        make_untextured(WALL, np.array([low[1], rear[0], high[0]]), cheek),
        make_untextured(WALL, np.array([low[0], high[1], rear[1]]), cheek),
        make_roof([high[1], high[0], rear[0], rear[1]], design),
    ]


def gabled_dormer(slope: RoofSlope, s: float, y: float, width: float, height: float, design: TexturedFacadeDesign) -> list[BoundarySurface]:
    """Returns a gabled front, two cheeks and two small roof slopes."""
    foot, peak = slope.slope * y, 0.75
    mid, back, ridge = s + width / 2, y + height / slope.slope, y + (height + peak) / slope.slope
    low = [slope.at(s, y, foot), slope.at(s + width, y, foot)]
    high = [slope.at(s + width, y, foot + height), slope.at(s, y, foot + height)]
    apex, end = slope.at(mid, y, foot + height + peak), slope.at(mid, ridge, foot + height + peak)
    rear = [slope.at(s + width, back, foot + height), slope.at(s, back, foot + height)]
    cheek = PlainMaterial("cheek")
    return [
        dormer_front([*low, high[0], apex, high[1]], design, width, height),
        make_untextured(WALL, np.array([low[1], rear[0], high[0]]), cheek),
        make_untextured(WALL, np.array([low[0], high[1], rear[1]]), cheek),
        make_roof([high[0], rear[0], end, apex], design),
        make_roof([rear[1], high[1], apex, end], design),
    ]


def chimneys(part_grid: PartGrid, rng: np.random.Generator) -> list[Installation]:
    """Returns one or two brick chimneys near the ridge."""
    candidates = slopes(part_grid)
    if not candidates:
        return []
    out: list[Installation] = []
    for _ in range(1 + int(rng.random() < 0.4)):
        slope = candidates[int(rng.integers(len(candidates)))]
        s = rng.uniform(0.25, 0.75) * slope.length_m
        y = slope.run_m * rng.uniform(0.7, 0.8)
        low, high = slope.slope * (y - 0.5), slope.rise_m + rng.uniform(0.7, 1.1)
        out.append((CHIMNEY, box([slope.at(s + a, y + b, 0) for a, b in SQUARE], low, high, RepeatingTexture("brick_red", 2.0))))
    return out


SQUARE = ((-0.35, -0.35), (0.35, -0.35), (0.35, 0.35), (-0.35, 0.35))


def box(
    feet: list[Points], low: float, high: float, material: RepeatingTexture | PlainMaterial, top: PlainMaterial | None = None
) -> list[BoundarySurface]:
    """An upright prism over a counter-clockwise ring, `low` and `high` above the ring's own heights, without floor."""
    lower = np.round(np.array(feet) + np.array([0, 0, low]), 4)
    upper = np.round(np.array(feet) + np.array([0, 0, high]), 4)
    surfaces = []
    for i in range(len(lower)):
        j = (i + 1) % len(lower)
        width = float(np.hypot(*(lower[j] - lower[i])[:2]))
        st = np.array([(0, 0), (width, 0), (width, high - low), (0, high - low)])
        surfaces.append(BoundarySurface(WALL, [TexturedFace([np.array([lower[i], lower[j], upper[j], upper[i]])], [st], material)]))
    surfaces.append(make_untextured(ROOF, upper, top or PlainMaterial("coping")))
    return surfaces


def balconies(part_grid: PartGrid, part: BuildingPart, design: TexturedFacadeDesign) -> list[Installation]:
    """Returns stacks of balconies on the front of a slab."""
    origin, end = part_grid.at(0, 0), part_grid.at(1, 0)
    length = float(np.hypot(*(end - origin)[:2]))
    along = (end - origin) / length
    out = np.array([along[1], -along[0], 0.0])
    fittings: list[Installation] = []
    ground = part_grid.eave_z - part.eave_m
    for bay in range(1, int(length / 7.5)):
        s = bay * 7.5
        for floor in range(1, part.storeys):
            z = ground + design.floor_m * (floor + 0.15)
            corners = [origin + along * s, origin + along * s + out * 1.3, origin + along * (s + 3.2) + out * 1.3, origin + along * (s + 3.2)]
            feet = [np.array([p[0], p[1], z]) for p in corners]
            fittings.append((BALCONY, box(feet, 0.0, 1.05, PlainMaterial(f"balcony_{bay % 2}"), PlainMaterial("concrete"))))
    return fittings


def make_planned(building: BuildingPlan, ground_z: float) -> list[Installation]:
    """Returns the columns and blocks that the plan defines."""
    fittings: list[Installation] = []
    for kind, (x, y, size, low, high) in building.installations:
        corners = 10 if kind == "column" else 4
        angle = np.arange(corners) * 2 * np.pi / corners + (np.pi / 4 if corners == 4 else 0)
        feet = [np.array([x + size * np.cos(a), y + size * np.sin(a), ground_z]) for a in angle]
        material = PlainMaterial({"column": "marble", "merlon": "masonry"}.get(kind, "concrete"))
        fittings.append((COLUMN if kind == "column" else BATTLEMENT, box(feet, low, high, material)))
    return fittings
