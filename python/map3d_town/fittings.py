"""What sits on a shell: dormers, chimneys, columns, balconies, battlements."""

import numpy as np
from numpy.typing import NDArray

from map3d_town.facade import TownDress
from map3d_town.model import ROOF, WALL, Body, Face, Lot, Opening, Paint, Part, Plain, Surface, Wrap
from map3d_town.shell import Frame, plain_surface, roof_surface, wall_surface

Points = NDArray[np.float64]
DORMER, CHIMNEY, BALCONY, COLUMN, BATTLEMENT = "1010", "1020", "1000", "1040", "1070"
Fitting = tuple[str, list[Surface]]


class Slope:
    """One roof slope seen along its eave: `at(s, y, z)` = s metres along, y metres inward, z above the slope's foot."""

    def __init__(self, frame: Frame, k: int, from_back: bool) -> None:
        i, j = (frame.last, frame.last - 1) if from_back else (0, 1)
        a, b = (k + 1, k) if from_back else (k, k + 1)
        self.origin, end, above = frame.at(a, i), frame.at(b, i), frame.at(a, j)
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


def add_fittings(body: Body, part: Part, lot: Lot, number: int, dress: TownDress, ground_z: float, rng: np.random.Generator) -> None:
    """Adds to a body what its part and look ask for."""
    frame = Frame(part, body.base_z, ground_z)
    if part.look in ("house", "timber", "gruender", "villa", "townhall", "row") and part.cover in ("tiles", "dark", "slate"):
        for slope in slopes(frame):
            body.installations += dormers(slope, dress, rng)
        body.installations += chimneys(frame, rng)
    if part.look == "slab":
        body.installations += balconies(frame, part, dress)
    if number == 0:
        body.installations += placed(lot, ground_z)
    for _, surfaces in body.installations:
        body.top_z = max([body.top_z, *(float(f.rings[0][:, 2].max()) for s in surfaces for f in s.faces)])


def slopes(frame: Frame) -> list[Slope]:
    """The slopes above the eaves that are long enough to carry something."""
    part = frame.part
    if part.half_hip_m or (len(part.profile) < 3 and not frame.narrows_to_nothing):
        return []
    out = [Slope(frame, k, False) for k in range(frame.strips)]
    if not part.closed:
        out += [Slope(frame, k, True) for k in range(frame.strips)]
    return [s for s in out if s.length_m > 4.5 and s.run_m > 1.2 and 0.45 < s.slope < 4]


def dormers(slope: Slope, dress: TownDress, rng: np.random.Generator) -> list[Fitting]:
    """Dormers in a row, or none: gabled ones on old houses, flat ones elsewhere."""
    chance = 0.65 if dress.look in ("house", "timber", "gruender", "townhall") else 0.3
    if rng.random() > chance:
        return []
    width, height = 1.35, 1.25
    count = int((slope.length_m - 1.2) / rng.uniform(2.8, 4.0))
    gabled = dress.look != "row" and rng.random() < 0.7
    start = 0.5 / max(slope.slope, 0.6)
    top = (height + (0.75 if gabled else 0)) / (slope.slope - 0.0 if gabled else slope.slope - 0.12)
    if slope.slope > 2 or start + top > slope.run_m - 0.15:
        return []
    places = [(i + 0.5) * slope.length_m / count for i in range(count)]
    build = gabled_dormer if gabled else flat_dormer
    return [(DORMER, build(slope, s - width / 2, start, width, height, dress)) for s in places]


def dormer_front(loop: list[Points], dress: TownDress, width: float, height: float) -> Surface:
    """The front of a dormer: a wall with one window."""
    front = wall_surface(loop, "blank", 0.0, dress)
    paint = front.faces[0].paint
    if isinstance(paint, Paint):
        window = Opening("window", 0.2, 0.2, width - 0.4, height - 0.4)
        traits = paint.traits - {"shutters", "cornice"} | {"plain"}
        front.faces[0].paint = Paint("facade", paint.width_m, paint.height_m, paint.colors, (window,), (), traits)
    return front


def flat_dormer(slope: Slope, s: float, y: float, width: float, height: float, dress: TownDress) -> list[Surface]:
    """Front, two cheeks and a roof that falls a little towards the front."""
    foot = slope.slope * y
    back = y + height / (slope.slope - 0.12)
    low = [slope.at(s, y, foot), slope.at(s + width, y, foot)]
    high = [slope.at(s + width, y, foot + height), slope.at(s, y, foot + height)]
    rear = [slope.at(s + width, back, slope.slope * back), slope.at(s, back, slope.slope * back)]
    cheek = Plain("cheek")
    return [
        dormer_front([*low, *high], dress, width, height),
        plain_surface(WALL, np.array([low[1], rear[0], high[0]]), cheek),
        plain_surface(WALL, np.array([low[0], high[1], rear[1]]), cheek),
        roof_surface([high[1], high[0], rear[0], rear[1]], dress),
    ]


def gabled_dormer(slope: Slope, s: float, y: float, width: float, height: float, dress: TownDress) -> list[Surface]:
    """Front with a gable, two cheeks, two small roof slopes."""
    foot, peak = slope.slope * y, 0.75
    mid, back, ridge = s + width / 2, y + height / slope.slope, y + (height + peak) / slope.slope
    low = [slope.at(s, y, foot), slope.at(s + width, y, foot)]
    high = [slope.at(s + width, y, foot + height), slope.at(s, y, foot + height)]
    apex, end = slope.at(mid, y, foot + height + peak), slope.at(mid, ridge, foot + height + peak)
    rear = [slope.at(s + width, back, foot + height), slope.at(s, back, foot + height)]
    cheek = Plain("cheek")
    return [
        dormer_front([*low, high[0], apex, high[1]], dress, width, height),
        plain_surface(WALL, np.array([low[1], rear[0], high[0]]), cheek),
        plain_surface(WALL, np.array([low[0], high[1], rear[1]]), cheek),
        roof_surface([high[0], rear[0], end, apex], dress),
        roof_surface([rear[1], high[1], apex, end], dress),
    ]


def chimneys(frame: Frame, rng: np.random.Generator) -> list[Fitting]:
    """One or two chimneys of brick beside the ridge."""
    candidates = slopes(frame)
    if not candidates:
        return []
    out: list[Fitting] = []
    for _ in range(1 + int(rng.random() < 0.4)):
        slope = candidates[int(rng.integers(len(candidates)))]
        s = rng.uniform(0.25, 0.75) * slope.length_m
        y = slope.run_m * rng.uniform(0.7, 0.8)
        low, high = slope.slope * (y - 0.5), slope.rise_m + rng.uniform(0.7, 1.1)
        out.append((CHIMNEY, box([slope.at(s + a, y + b, 0) for a, b in SQUARE], low, high, Wrap("brick_red", 2.0))))
    return out


SQUARE = ((-0.35, -0.35), (0.35, -0.35), (0.35, 0.35), (-0.35, 0.35))


def box(feet: list[Points], low: float, high: float, paint: Wrap | Plain, top: Plain | None = None) -> list[Surface]:
    """An upright prism over a counter-clockwise ring, `low` and `high` above the ring's own heights, without floor."""
    lower = np.round(np.array(feet) + np.array([0, 0, low]), 4)
    upper = np.round(np.array(feet) + np.array([0, 0, high]), 4)
    surfaces = []
    for i in range(len(lower)):
        j = (i + 1) % len(lower)
        width = float(np.hypot(*(lower[j] - lower[i])[:2]))
        st = np.array([(0, 0), (width, 0), (width, high - low), (0, high - low)])
        surfaces.append(Surface(WALL, [Face([np.array([lower[i], lower[j], upper[j], upper[i]])], [st], paint)]))
    surfaces.append(plain_surface(ROOF, upper, top or Plain("coping")))
    return surfaces


def balconies(frame: Frame, part: Part, dress: TownDress) -> list[Fitting]:
    """A stack of balconies on the southern long side of a slab."""
    origin, end = frame.at(0, 0), frame.at(1, 0)
    length = float(np.hypot(*(end - origin)[:2]))
    along = (end - origin) / length
    out = np.array([along[1], -along[0], 0.0])
    fittings: list[Fitting] = []
    ground = frame.eave_z - part.eave_m
    for bay in range(1, int(length / 7.5)):
        s = bay * 7.5
        for floor in range(1, part.storeys):
            z = ground + dress.floor_m * (floor + 0.15)
            corners = [origin + along * s, origin + along * s + out * 1.3, origin + along * (s + 3.2) + out * 1.3, origin + along * (s + 3.2)]
            feet = [np.array([p[0], p[1], z]) for p in corners]
            fittings.append((BALCONY, box(feet, 0.0, 1.05, Plain(f"balcony_{bay % 2}"), Plain("concrete"))))
    return fittings


def placed(lot: Lot, ground_z: float) -> list[Fitting]:
    """What the plan puts in certain places: columns (x, y, radius, low, high) and blocks (x, y, half, low, high)."""
    fittings: list[Fitting] = []
    for kind, (x, y, size, low, high) in lot.extras:
        corners = 10 if kind == "column" else 4
        angle = np.arange(corners) * 2 * np.pi / corners + (np.pi / 4 if corners == 4 else 0)
        feet = [np.array([x + size * np.cos(a), y + size * np.sin(a), ground_z]) for a in angle]
        material = Plain({"column": "marble", "merlon": "masonry"}.get(kind, "concrete"))
        fittings.append((COLUMN if kind == "column" else BATTLEMENT, box(feet, low, high, material)))
    return fittings
