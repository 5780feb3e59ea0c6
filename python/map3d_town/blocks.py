"""What fills the blocks of the town: perimeter blocks, rows, detached houses, slabs, halls, parks."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from map3d_town.cars import park_cars
from map3d_town.massing import FLAT, HALF_HIP, MANSARD, blank_part, flat_part, gable, gable_front_part, hipped_part, mansard, row_part, saw_teeth
from map3d_town.model import Part
from map3d_town.plane import area, contains, keeps_its_edges, left, offset, rectangle, split, unit
from map3d_town.sketch import Sketch

Points = NDArray[np.float64]
RESIDENTIAL, COMMERCIAL, INDUSTRIAL, GARAGE = "1000", "1150", "1110", "1610"


@dataclass(frozen=True)
class Block:
    """A block between streets: a convex outline, counter-clockwise, and the names of the streets along its edges."""

    outline: Points
    streets: tuple[str, ...]
    rng: np.random.Generator

    def edge(self, i: int) -> tuple[Points, Points]:
        return self.outline[i], self.outline[(i + 1) % len(self.outline)]

    def street(self, i: int) -> str:
        return self.streets[i % len(self.streets)]


@dataclass(frozen=True)
class Manner:
    """How a perimeter block is built: depth, storeys, lot widths, looks."""

    depth_m: float
    storeys: tuple[int, int]
    storey_m: float
    width_m: tuple[float, float]
    looks: tuple[str, ...]
    gable_fronts: float
    mansards: float
    ground: str
    covers: tuple[str, ...] = ("tiles", "tiles", "tiles", "tiles", "tiles", "dark")
    pitch_deg: tuple[float, float] = (30, 40)


OLD = Manner(9.5, (2, 4), 2.95, (7.0, 12.5), ("house", "house", "house", "timber"), 0.28, 0.12, "yard", pitch_deg=(40, 52))
GRUENDER = Manner(11.5, (4, 5), 3.35, (11.0, 17.0), ("gruender",), 0.0, 0.45, "garden")


def fill_perimeter(sketch: Sketch, block: Block, manner: Manner) -> bool:
    """Houses wall to wall along all edges around a courtyard; False when the block is too small for one."""
    outline, depth = block.outline, manner.depth_m
    inner = offset(outline, depth)
    if not keeps_its_edges(outline, inner, 4.0) or area(inner) < 60:
        return depth > 7.0 and fill_perimeter(sketch, block, replace(manner, depth_m=depth - 1.5))
    sketch.patch(outline, "lawn", "block")
    sketch.patch(inner, manner.ground, "parcel")
    n = len(outline)
    spans = [_edge_spans(block, inner, i, manner) for i in range(n)]
    numbers = [1] * n
    for i in range(n):
        _corner_house(sketch, block, inner, i, spans, manner)
        start, end = spans[i]
        a, b = block.edge(i)
        along = unit(b - a)
        for s0, s1 in _lots(start, end, manner.width_m, block.rng):
            _row_house(sketch, block, a + along * s0, a + along * s1, manner, block.street(i), numbers[i])
            numbers[i] += 2
    _courtyard(sketch, block, inner)
    return True


def _edge_spans(block: Block, inner: Points, i: int, manner: Manner) -> tuple[float, float]:
    """Where along edge i the corner houses end and begin."""
    a, b = block.edge(i)
    along, length = unit(b - a), float(np.hypot(*(b - a)))
    first = float((inner[i] - a) @ along)
    last = float((inner[(i + 1) % len(inner)] - a) @ along)
    room = last - first
    grow = min(4.0, room / 2) if room < 12 else min(4.0, room / 4)
    start = max(first, min(first + grow, 7.5))
    end = min(last, max(last - grow, length - 7.5))
    if end - start < manner.width_m[0] * 0.8:
        start = end = (start + end) / 2
    return start, end


def _lots(start: float, end: float, width_m: tuple[float, float], rng: np.random.Generator) -> list[tuple[float, float]]:
    """The span cut into lots of irregular width."""
    length = end - start
    if length < 1.0:
        return []
    count = max(1, round(length / ((width_m[0] + width_m[1]) / 2)))
    weights = rng.uniform(width_m[0], width_m[1], count)
    cuts = start + length * np.concatenate([[0.0], np.cumsum(weights) / weights.sum()])
    return [(float(cuts[i]), float(cuts[i + 1])) for i in range(count)]


def _manner_part(manner: Manner, rng: np.random.Generator, extra: int = 0) -> Part:
    """Storeys, look and cover of one house."""
    storeys = int(rng.integers(manner.storeys[0], manner.storeys[1] + 1)) + extra
    look = manner.looks[int(rng.integers(len(manner.looks)))]
    cover = manner.covers[int(rng.integers(len(manner.covers)))]
    eave = storeys * manner.storey_m + float(rng.uniform(0.2, 1.0))
    return blank_part(eave, storeys, look, cover, overhang_m=float(rng.uniform(0.3, 0.5)))


def _roof_over(depth_m: float, manner: Manner, rng: np.random.Generator) -> tuple[tuple[tuple[float, float], ...], str]:
    if rng.random() < manner.mansards:
        return mansard(depth_m), MANSARD
    return gable(depth_m, float(rng.uniform(*manner.pitch_deg))), "1030"


def _row_house(sketch: Sketch, block: Block, a: Points, b: Points, manner: Manner, street: str, number: int) -> None:
    rng, width = block.rng, float(np.hypot(*(b - a)))
    part = _manner_part(manner, rng)
    if width < 10 and rng.random() < manner.gable_fronts:
        profile = gable(width, float(rng.uniform(48, 58)))
        made = gable_front_part(a, b, manner.depth_m, profile, part, ("party", "party", "street", "yard"))
    else:
        profile, kind = _roof_over(manner.depth_m, manner, rng)
        made = row_part(a, b, manner.depth_m, profile, replace(part, roof_type=kind), ("street", "yard", "party", "party"))
    kind = "gruender" if manner.looks == GRUENDER.looks else "house"
    sketch.lot(kind, COMMERCIAL if rng.random() < 0.3 else RESIDENTIAL, [made], street, number)


def _corner_house(sketch: Sketch, block: Block, inner: Points, i: int, spans: list[tuple[float, float]], manner: Manner) -> None:
    """A house around corner i, as deep as its neighbours on both streets."""
    outline, n = block.outline, len(block.outline)
    corner = outline[i]
    (before, _), (_, after) = block.edge((i - 1) % n), block.edge(i)
    come, go = unit(corner - before), unit(after - corner)
    a, b = before + come * spans[i - 1][1], corner + go * spans[i][0]
    front = np.array([a, corner, b])
    back = np.array([a + left(come) * manner.depth_m, inner[i], b + left(go) * manner.depth_m])
    part = _manner_part(manner, block.rng, int(block.rng.random() < 0.4))
    profile, kind = _roof_over(manner.depth_m, manner, block.rng)
    sides = ("street", "street", "yard", "yard", "party", "party")
    made = replace(part, front=front, back=back, profile=profile, sides=sides, roof_type=kind)
    function = COMMERCIAL if block.rng.random() < 0.6 else RESIDENTIAL
    sketch.lot("gruender" if manner.looks == GRUENDER.looks else "house", function, [made], block.street(i), 2)


def _courtyard(sketch: Sketch, block: Block, inner: Points) -> None:
    """Trees, and a shed in larger yards."""
    rng = block.rng
    for point in scattered(inner, int(area(inner) / 110), 2.5, rng):
        sketch.tree(point, "linden", 7.0, rng)
    if area(inner) > 260 and rng.random() < 0.7:
        spot = scattered(offset(inner, 0.0), 1, 5.0, rng)
        if len(spot):
            along = unit(inner[1] - inner[0])
            shed(sketch, rectangle(spot[0], along, 5.0, 3.2), rng)


def shed(sketch: Sketch, ground: Points, rng: np.random.Generator) -> None:
    """A shed or garage with a flat or shed roof, as a simple solid."""
    part = blank_part(2.5, 1, "shed", "flat", roof_type=FLAT)
    profile = ((0.0, 0.0), (1.0, float(rng.uniform(0.2, 0.6))))
    width = float(np.hypot(*(ground[3] - ground[0])))
    sketch.lot("shed", GARAGE, [row_part(ground[0], ground[1], width, profile, part, ("blank",) * 4)])


def scattered(polygon: Points, count: int, margin_m: float, rng: np.random.Generator) -> Points:
    """Random points inside a convex polygon."""
    if count <= 0 or len(polygon) < 3:
        return np.zeros((0, 2))
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    points = rng.uniform(low, high, (count * 4, 2))
    return np.asarray(points[contains(polygon, points, margin_m)][:count])


def parcels(outline: Points, target_m2: float, rng: np.random.Generator) -> list[Points]:
    """The polygon cut across its longest side until the pieces are about as large as wanted."""
    if area(outline) < target_m2 * 1.5:
        return [outline]
    edges = np.roll(outline, -1, axis=0) - outline
    along = unit(edges[int(np.argmax(np.hypot(edges[:, 0], edges[:, 1])))])
    reach = outline @ along
    spread = outline @ left(along)
    if np.ptp(spread) > np.ptp(reach):
        along, reach = left(along), spread
    cut = reach.min() + np.ptp(reach) * rng.uniform(0.42, 0.58)
    middle = outline.mean(axis=0)
    at = middle + along * (cut - middle @ along)
    pieces = split(outline, at, along)
    return [p for piece in pieces if len(piece) >= 3 for p in parcels(piece, target_m2, rng)]


def street_edge(parcel: Points, outline: Points) -> int:
    """The longest edge of the parcel that lies on the block's outline, or -1."""
    after = np.concatenate([parcel[1:], parcel[:1]])
    middle, length = (parcel + after) / 2, np.hypot(*(after - parcel).T)
    ahead = np.concatenate([outline[1:], outline[:1]]) - outline
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    away = middle[:, None] - outline
    beside = np.abs(away[..., 1] * ahead[:, 0] - away[..., 0] * ahead[:, 1]).min(axis=1)
    lengths = np.where(beside < 0.1, length, 0.0)
    best = int(np.argmax(lengths))
    return best if lengths[best] > 6.0 else -1


def fill_villas(sketch: Sketch, block: Block) -> None:
    """Detached houses in gardens."""
    sketch.patch(block.outline, "lawn", "block")
    for parcel in parcels(block.outline, float(block.rng.uniform(430, 620)), block.rng):
        sketch.patch(offset(parcel, 0.5), ("lawn", "garden", "lawn_light")[int(block.rng.integers(3))], "parcel")
        edge = street_edge(parcel, block.outline)
        if edge >= 0 and not _villa(sketch, block, parcel, edge):
            for point in scattered(parcel, 3, 2.0, block.rng):
                sketch.tree(point, "apple", 5.0, block.rng)


def _villa(sketch: Sketch, block: Block, parcel: Points, edge: int) -> bool:
    """A house behind its front garden, with a drive, a garage and trees; False when there is no room."""
    rng = block.rng
    a, b = parcel[edge], parcel[(edge + 1) % len(parcel)]
    along = unit(b - a)
    inward = left(along)
    for size in (1.0, 0.85, 0.72):
        length, width = float(rng.uniform(10, 13.5)) * size, float(rng.uniform(8.5, 10.5)) * size
        setback = float(rng.uniform(4.0, 6.5))
        ground = rectangle((a + b) / 2 + inward * (setback + width / 2), along, length, width)
        if contains(parcel, ground, 1.2).all():
            break
    else:
        return False
    sketch.lot("villa", RESIDENTIAL, [villa_part(ground, rng)], block.street(edge), 1 + 2 * int(rng.integers(1, 40)))
    door = (ground[0] + ground[1]) / 2
    sketch.patch(rectangle(door - inward * setback / 2, inward, setback, 1.4), "sidewalk", "path")
    _garage(sketch, parcel, ground, along, setback, rng)
    for point in scattered(parcel, 4, 1.5, rng):
        if not contains(ground, point[None], -2.2)[0]:
            sketch.tree(point, ("linden", "apple", "fir", "apple")[int(rng.integers(4))], float(rng.uniform(4, 9)), rng)
    return True


def _garage(sketch: Sketch, parcel: Points, ground: Points, along: Points, setback: float, rng: np.random.Generator) -> None:
    inward = left(along)
    centre = ground[1] + along * 2.6 + inward * 3.2
    box = rectangle(centre, along, 3.2, 6.0)
    if rng.random() < 0.6 and contains(parcel, box, 0.15).all():
        shed(sketch, box, rng)
        sketch.patch(rectangle(ground[1] + along * 2.6 - inward * setback / 2, inward, setback, 3.0), "gravel", "path")


def villa_part(ground: Points, rng: np.random.Generator) -> Part:
    """A house under a gabled, half-hipped, hipped, mansard or flat roof."""
    storeys = int(rng.integers(1, 3))
    part = blank_part(storeys * 2.9 + 0.5, storeys, "villa", "tiles" if rng.random() < 0.7 else "dark", overhang_m=0.5)
    choice, width = rng.random(), float(np.hypot(*(ground[3] - ground[0])))
    if choice < 0.25:
        return hipped_part(ground, float(rng.uniform(28, 40)), part)
    if choice < 0.35:
        return hipped_part(ground, 30.0, replace(part, overhang_m=0.3), steep=True)
    if choice < 0.48:
        return flat_part(ground, replace(part, cover="flat", eave_m=part.eave_m + 2.6, storeys=storeys + 1))
    profile = gable(width, float(rng.uniform(35, 48)))
    made = row_part(ground[0], ground[1], width, profile, part, ("street", "yard", "yard", "yard"))
    if choice < 0.65:
        return replace(made, half_hip_m=profile[1][1] * 0.4, roof_type=HALF_HIP)
    return made


def fill_rows(sketch: Sketch, block: Block) -> None:
    """Rows of equal houses along the two longest edges, gardens between them."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "lawn", "block")
    inner = offset(outline, 4.0)
    edges = np.roll(inner, -1, axis=0) - inner
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    for i in sorted(range(len(inner)), key=lambda e: -lengths[e])[:2]:
        a, b = inner[i], inner[(i + 1) % len(inner)]
        along, inward, depth = unit(b - a), left(unit(b - a)), 9.5
        part = blank_part(6.2 + float(rng.uniform(0, 0.8)), 2, "row", "tiles" if rng.random() < 0.6 else "dark", 0.4)
        profile = gable(depth, float(rng.uniform(32, 42)))
        start, count = _room(outline, a, along, inward, float(lengths[i]), depth)
        for u in range(count):
            p, q = a + along * (start + u * 6.4), a + along * (start + (u + 1) * 6.4)
            ends = ("yard" if u == 0 else "party", "yard" if u == count - 1 else "party")
            sketch.lot("row", RESIDENTIAL, [row_part(p, q, depth, profile, part, ("street", "yard", *ends))], block.street(i), 1 + 2 * u)
            sketch.patch(rectangle((p + q) / 2 - inward * 2, inward, 4.0, 1.3), "sidewalk", "path")
            back = (p + q) / 2 + inward * (depth + 5)
            sketch.patch(rectangle(back, along, 6.1, 9.4), ("garden", "lawn_light")[u % 2], "parcel")
            if contains(outline, back[None], 3.0)[0] and rng.random() < 0.7:
                sketch.tree(back + inward * 2.5, "apple", 4.5, rng)


def _room(outline: Points, a: Points, along: Points, inward: Points, length: float, depth: float) -> tuple[float, int]:
    """Where a row of houses can begin, and how many there are, so that all keep inside and clear of the opposite row."""
    steps = np.arange(0.0, max(length, 0.1), 0.5)
    points = a + steps[:, None] * along
    free = contains(outline, points, 2.0) & contains(outline, points + inward * (depth + 9.0), 1.0)
    if not free.any():
        return 0.0, 0
    inside = steps[free]
    count = int((inside[-1] - inside[0]) / 6.4)
    return float(inside[0] + (inside[-1] - inside[0] - count * 6.4) / 2), count


def fill_slabs(sketch: Sketch, block: Block) -> None:
    """Apartment slabs in parallel on a lawn."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "lawn_light", "block")
    along = unit(outline[1] - outline[0])
    if float((outline[1] - outline[0]) @ along) < float(np.hypot(*(outline[2] - outline[1]))):
        along = unit(outline[2] - outline[1])
    across = left(along)
    reach = outline @ across
    middle = outline.mean(axis=0)
    for level in np.arange(reach.min() + 12, reach.max() - 10, 27.0):
        for length in (46.0, 36.0, 26.0, 20.0):
            ground = rectangle(middle + across * (level - middle @ across), along, length, 11.5)
            if contains(outline, ground, 3.0).all():
                storeys = int(rng.integers(4, 8))
                part = blank_part(storeys * 2.85 + 0.6, storeys, "slab", "flat")
                sketch.lot("slab", RESIDENTIAL, [flat_part(ground, part)], block.street(0), int(rng.integers(1, 60)))
                sketch.patch(rectangle(ground.mean(axis=0) + across * 11.5, along, length, 6.0), "asphalt", "path")
                park_cars(sketch, outline, ground[3] + across * 5.8, along, length, rng)
                break
    for point in scattered(outline, int(area(outline) / 200), 2.0, rng):
        if not any(contains(lot.parts[0].front, point[None], -4.0)[0] for lot in sketch.plan.lots[-4:] if len(lot.parts[0].front) == 4):
            sketch.tree(point, "linden", 9.0, rng)


def fill_industry(sketch: Sketch, block: Block) -> None:
    """A hall with saw-tooth or low roof, an office, a paved yard."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "concrete", "block")
    along = unit(outline[1] - outline[0])
    middle = outline.mean(axis=0)
    for size in (44.0, 36.0, 28.0, 20.0, 14.0):
        ground = rectangle(middle, along, size, size * 0.62)
        if contains(outline, ground, 4.0).all():
            part = blank_part(7.0, 1, "industrial", "metal")
            profile = saw_teeth(int(size / 7), 2.4) if rng.random() < 0.55 else gable(size * 0.62, 9.0)
            kind = "1080" if len(profile) > 3 else "1030"
            made = row_part(ground[0], ground[1], size * 0.62, profile, replace(part, roof_type=kind), ("street", "yard", "yard", "yard"))
            sketch.lot("industrial", INDUSTRIAL, [made], block.street(0), int(rng.integers(1, 20)))
            park_cars(sketch, outline, ground[0] - left(along) * 5.5, along, size, rng)
            park_cars(sketch, outline, ground[3] + left(along) * 6.0, along, size, rng)
            break
    for corner in range(len(outline)):
        spot = outline[corner] + unit(middle - outline[corner]) * 13.0
        office = rectangle(spot, along, 13.0, 9.0)
        if contains(outline, office, 1.0).all() and not contains(ground, office, -3.0).any():
            part = blank_part(9.4, 3, "slab", "flat")
            sketch.lot("office", COMMERCIAL, [flat_part(office, part)], block.street(0), int(rng.integers(1, 20)))
            break
