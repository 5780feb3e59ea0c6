"""Fills blocks with buildings: perimeter blocks, row houses, detached houses, slabs, halls."""

from dataclasses import dataclass, replace

import numpy as np

from map3d_town.layout.massing import (
    FLAT,
    HALF_HIP,
    MANSARD,
    flat_part,
    gable_front_part,
    gable_profile,
    hipped_part,
    mansard_profile,
    part_without_outline,
    row_part,
    saw_tooth_profile,
)
from map3d_town.layout.parked_cars import park_cars
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.layout.town_plan import BuildingPart
from map3d_town.polygons_2d import Points, area, contains, keeps_its_edges, left_normal, offset, rectangle, split, unit

RESIDENTIAL, COMMERCIAL, INDUSTRIAL, GARAGE = "31001_1010", "31001_2010", "31001_2110", "31001_2463"
"""Functions of the German cadastre (AdV), whose labels map3d knows."""


@dataclass(frozen=True)
class CityBlock:
    """A block between streets: a convex, counter-clockwise outline, the names of the streets along its edges, and its random generator."""

    outline: Points
    streets: tuple[str, ...]
    rng: np.random.Generator

    def edge(self, i: int) -> tuple[Points, Points]:
        return self.outline[i], self.outline[(i + 1) % len(self.outline)]

    def street(self, i: int) -> str:
        return self.streets[i % len(self.streets)]


@dataclass(frozen=True)
class PerimeterStyle:
    """The style of a perimeter block. `gable_fronts`, `mansards`: shares of houses; `ground`: material of the courtyard; ranges are (low, high)."""

    depth_m: float
    storeys: tuple[int, int]
    storey_m: float
    width_m: tuple[float, float]
    facade_kinds: tuple[str, ...]
    gable_fronts: float
    mansards: float
    ground: str
    covers: tuple[str, ...] = ("tiles", "tiles", "tiles", "tiles", "tiles", "dark")
    pitch_deg: tuple[float, float] = (30, 40)


OLD = PerimeterStyle(9.5, (2, 4), 2.95, (7.0, 12.5), ("house", "house", "house", "timber"), 0.28, 0.12, "yard", pitch_deg=(40, 52))
GRUENDER = PerimeterStyle(11.5, (4, 5), 3.35, (11.0, 17.0), ("gruender",), 0.0, 0.45, "garden")


def fill_perimeter(builder: PlanBuilder, block: CityBlock, style: PerimeterStyle) -> bool:
    """Adds terraced houses along all edges around a courtyard. Returns False when the block is too small for a courtyard."""
    outline, depth = block.outline, style.depth_m
    inner = offset(outline, depth)
    if not keeps_its_edges(outline, inner, 4.0) or area(inner) < 60:
        return depth > 7.0 and fill_perimeter(builder, block, replace(style, depth_m=depth - 1.5))
    builder.add_ground(outline, "lawn", "block")
    builder.add_ground(inner, style.ground, "parcel")
    n = len(outline)
    spans = [_edge_spans(block, inner, i, style) for i in range(n)]
    numbers = [1] * n
    for i in range(n):
        _add_corner_house(builder, block, inner, i, spans, style)
        start, end = spans[i]
        a, b = block.edge(i)
        along = unit(b - a)
        for s0, s1 in _split_into_lots(start, end, style.width_m, block.rng):
            _add_row_house(builder, block, a + along * s0, a + along * s1, style, block.street(i), numbers[i])
            numbers[i] += 2
    _plant_courtyard(builder, block, inner)
    return True


def _edge_spans(block: CityBlock, inner: Points, i: int, style: PerimeterStyle) -> tuple[float, float]:
    """Returns the distances along edge i at which the first corner house ends and the second begins."""
    a, b = block.edge(i)
    along, length = unit(b - a), float(np.hypot(*(b - a)))
    first = float((inner[i] - a) @ along)
    last = float((inner[(i + 1) % len(inner)] - a) @ along)
    room = last - first
    grow = min(4.0, room / 2) if room < 12 else min(4.0, room / 4)
    start = max(first, min(first + grow, 7.5))
    end = min(last, max(last - grow, length - 7.5))
    if end - start < style.width_m[0] * 0.8:
        start = end = (start + end) / 2
    return start, end


def _split_into_lots(start: float, end: float, width_m: tuple[float, float], rng: np.random.Generator) -> list[tuple[float, float]]:
    """Cuts the span into lots of random width."""
    length = end - start
    if length < 1.0:
        return []
    count = max(1, round(length / ((width_m[0] + width_m[1]) / 2)))
    weights = rng.uniform(width_m[0], width_m[1], count)
    cuts = start + length * np.concatenate([[0.0], np.cumsum(weights) / weights.sum()])
    return [(float(cuts[i]), float(cuts[i + 1])) for i in range(count)]


def _choose_part(style: PerimeterStyle, rng: np.random.Generator, extra: int = 0) -> BuildingPart:
    """Chooses storeys, facade and roof cover of a house."""
    storeys = int(rng.integers(style.storeys[0], style.storeys[1] + 1)) + extra
    facade_kind = style.facade_kinds[int(rng.integers(len(style.facade_kinds)))]
    cover = style.covers[int(rng.integers(len(style.covers)))]
    eave = storeys * style.storey_m + float(rng.uniform(0.2, 1.0))
    return part_without_outline(eave, storeys, facade_kind, cover, overhang_m=float(rng.uniform(0.3, 0.5)))


def _choose_roof(depth_m: float, style: PerimeterStyle, rng: np.random.Generator) -> tuple[tuple[tuple[float, float], ...], str]:
    if rng.random() < style.mansards:
        return mansard_profile(depth_m), MANSARD
    return gable_profile(depth_m, float(rng.uniform(*style.pitch_deg))), "1030"


def _add_row_house(builder: PlanBuilder, block: CityBlock, a: Points, b: Points, style: PerimeterStyle, street: str, number: int) -> None:
    rng, width = block.rng, float(np.hypot(*(b - a)))
    part = _choose_part(style, rng)
    if width < 10 and rng.random() < style.gable_fronts:
        profile = gable_profile(width, float(rng.uniform(48, 58)))
        made = gable_front_part(a, b, style.depth_m, profile, part, ("party", "party", "street", "yard"))
    else:
        profile, kind = _choose_roof(style.depth_m, style, rng)
        made = row_part(a, b, style.depth_m, profile, replace(part, roof_type=kind), ("street", "yard", "party", "party"))
    kind = "gruender" if style.facade_kinds == GRUENDER.facade_kinds else "house"
    builder.add_building(kind, COMMERCIAL if rng.random() < 0.3 else RESIDENTIAL, [made], street, number)


def _add_corner_house(builder: PlanBuilder, block: CityBlock, inner: Points, i: int, spans: list[tuple[float, float]], style: PerimeterStyle) -> None:
    """Adds a house around corner i, as deep as its neighbours on both streets."""
    outline, n = block.outline, len(block.outline)
    corner = outline[i]
    (before, _), (_, after) = block.edge((i - 1) % n), block.edge(i)
    come, go = unit(corner - before), unit(after - corner)
    a, b = before + come * spans[i - 1][1], corner + go * spans[i][0]
    front = np.array([a, corner, b])
    back = np.array([a + left_normal(come) * style.depth_m, inner[i], b + left_normal(go) * style.depth_m])
    part = _choose_part(style, block.rng, int(block.rng.random() < 0.4))
    profile, kind = _choose_roof(style.depth_m, style, block.rng)
    sides = ("street", "street", "yard", "yard", "party", "party")
    made = replace(part, front=front, back=back, profile=profile, sides=sides, roof_type=kind)
    function = COMMERCIAL if block.rng.random() < 0.6 else RESIDENTIAL
    builder.add_building("gruender" if style.facade_kinds == GRUENDER.facade_kinds else "house", function, [made], block.street(i), 2)


def _plant_courtyard(builder: PlanBuilder, block: CityBlock, inner: Points) -> None:
    """Adds trees, and a shed in larger courtyards."""
    rng = block.rng
    for point in random_points(inner, int(area(inner) / 110), 2.5, rng):
        builder.add_tree(point, "linden", 7.0, rng)
    if area(inner) > 260 and rng.random() < 0.7:
        spot = random_points(offset(inner, 0.0), 1, 5.0, rng)
        if len(spot):
            along = unit(inner[1] - inner[0])
            add_shed(builder, rectangle(spot[0], along, 5.0, 3.2), rng)


def add_shed(builder: PlanBuilder, ground: Points, rng: np.random.Generator) -> None:
    """Adds a shed or garage with a shed roof."""
    part = part_without_outline(2.5, 1, "shed", "flat", roof_type=FLAT)
    profile = ((0.0, 0.0), (1.0, float(rng.uniform(0.2, 0.6))))
    width = float(np.hypot(*(ground[3] - ground[0])))
    builder.add_building("shed", GARAGE, [row_part(ground[0], ground[1], width, profile, part, ("blank",) * 4)])


def random_points(polygon: Points, count: int, margin_m: float, rng: np.random.Generator) -> Points:
    """Returns at most `count` random points inside a convex polygon, at least `margin_m` from its edges."""
    if count <= 0 or len(polygon) < 3:
        return np.zeros((0, 2))
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    points = rng.uniform(low, high, (count * 4, 2))
    return np.asarray(points[contains(polygon, points, margin_m)][:count])


def split_into_parcels(outline: Points, target_m2: float, rng: np.random.Generator) -> list[Points]:
    """Cuts the polygon across its longer direction until the pieces have about the target area."""
    if area(outline) < target_m2 * 1.5:
        return [outline]
    edges = np.roll(outline, -1, axis=0) - outline
    along = unit(edges[int(np.argmax(np.hypot(edges[:, 0], edges[:, 1])))])
    reach = outline @ along
    spread = outline @ left_normal(along)
    if np.ptp(spread) > np.ptp(reach):
        along, reach = left_normal(along), spread
    cut = reach.min() + np.ptp(reach) * rng.uniform(0.42, 0.58)
    middle = outline.mean(axis=0)
    at = middle + along * (cut - middle @ along)
    pieces = split(outline, at, along)
    return [p for piece in pieces if len(piece) >= 3 for p in split_into_parcels(piece, target_m2, rng)]


def find_street_edge(parcel: Points, outline: Points) -> int:
    """Returns the number of the longest edge of the parcel on the block's outline, or -1."""
    after = np.concatenate([parcel[1:], parcel[:1]])
    middle, length = (parcel + after) / 2, np.hypot(*(after - parcel).T)
    ahead = np.concatenate([outline[1:], outline[:1]]) - outline
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    away = middle[:, None] - outline
    distance = np.abs(away[..., 1] * ahead[:, 0] - away[..., 0] * ahead[:, 1]).min(axis=1)
    lengths = np.where(distance < 0.1, length, 0.0)
    best = int(np.argmax(lengths))
    return best if lengths[best] > 6.0 else -1


def fill_villas(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds detached houses in gardens."""
    builder.add_ground(block.outline, "lawn", "block")
    for parcel in split_into_parcels(block.outline, float(block.rng.uniform(430, 620)), block.rng):
        builder.add_ground(offset(parcel, 0.5), ("lawn", "garden", "lawn_light")[int(block.rng.integers(3))], "parcel")
        edge = find_street_edge(parcel, block.outline)
        if edge >= 0 and not _add_villa(builder, block, parcel, edge):
            for point in random_points(parcel, 3, 2.0, block.rng):
                builder.add_tree(point, "apple", 5.0, block.rng)


def _add_villa(builder: PlanBuilder, block: CityBlock, parcel: Points, edge: int) -> bool:
    """Adds a house behind a front garden, with a drive, a garage and trees. Returns False when the parcel is too small."""
    rng = block.rng
    a, b = parcel[edge], parcel[(edge + 1) % len(parcel)]
    along = unit(b - a)
    inward = left_normal(along)
    for size in (1.0, 0.85, 0.72):
        length, width = float(rng.uniform(10, 13.5)) * size, float(rng.uniform(8.5, 10.5)) * size
        setback = float(rng.uniform(4.0, 6.5))
        ground = rectangle((a + b) / 2 + inward * (setback + width / 2), along, length, width)
        if contains(parcel, ground, 1.2).all():
            break
    else:
        return False
    builder.add_building("villa", RESIDENTIAL, [choose_villa(ground, rng)], block.street(edge), 1 + 2 * int(rng.integers(1, 40)))
    door = (ground[0] + ground[1]) / 2
    builder.add_ground(rectangle(door - inward * setback / 2, inward, setback, 1.4), "sidewalk", "path")
    _add_garage(builder, parcel, ground, along, setback, rng)
    for point in random_points(parcel, 4, 1.5, rng):
        if not contains(ground, point[None], -2.2)[0]:
            builder.add_tree(point, ("linden", "apple", "fir", "apple")[int(rng.integers(4))], float(rng.uniform(4, 9)), rng)
    return True


def _add_garage(builder: PlanBuilder, parcel: Points, ground: Points, along: Points, setback: float, rng: np.random.Generator) -> None:
    inward = left_normal(along)
    centre = ground[1] + along * 2.6 + inward * 3.2
    box = rectangle(centre, along, 3.2, 6.0)
    if rng.random() < 0.6 and contains(parcel, box, 0.15).all():
        add_shed(builder, box, rng)
        builder.add_ground(rectangle(ground[1] + along * 2.6 - inward * setback / 2, inward, setback, 3.0), "gravel", "path")


def choose_villa(ground: Points, rng: np.random.Generator) -> BuildingPart:
    """Chooses a house with a gabled, half-hipped, hipped, mansard or flat roof."""
    storeys = int(rng.integers(1, 3))
    part = part_without_outline(storeys * 2.9 + 0.5, storeys, "villa", "tiles" if rng.random() < 0.7 else "dark", overhang_m=0.5)
    choice, width = rng.random(), float(np.hypot(*(ground[3] - ground[0])))
    if choice < 0.25:
        return hipped_part(ground, float(rng.uniform(28, 40)), part)
    if choice < 0.35:
        return hipped_part(ground, 30.0, replace(part, overhang_m=0.3), steep=True)
    if choice < 0.48:
        return flat_part(ground, replace(part, cover="flat", eave_m=part.eave_m + 2.6, storeys=storeys + 1))
    profile = gable_profile(width, float(rng.uniform(35, 48)))
    made = row_part(ground[0], ground[1], width, profile, part, ("street", "yard", "yard", "yard"))
    if choice < 0.65:
        return replace(made, half_hip_m=profile[1][1] * 0.4, roof_type=HALF_HIP)
    return made


def fill_rows(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds rows of equal houses along the two longest edges, with gardens between them."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "lawn", "block")
    inner = offset(outline, 4.0)
    edges = np.roll(inner, -1, axis=0) - inner
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    for i in sorted(range(len(inner)), key=lambda e: -lengths[e])[:2]:
        a, b = inner[i], inner[(i + 1) % len(inner)]
        along, inward, depth = unit(b - a), left_normal(unit(b - a)), 9.5
        part = part_without_outline(6.2 + float(rng.uniform(0, 0.8)), 2, "row", "tiles" if rng.random() < 0.6 else "dark", 0.4)
        profile = gable_profile(depth, float(rng.uniform(32, 42)))
        start, count = _row_extent(outline, a, along, inward, float(lengths[i]), depth)
        for u in range(count):
            p, q = a + along * (start + u * 6.4), a + along * (start + (u + 1) * 6.4)
            ends = ("yard" if u == 0 else "party", "yard" if u == count - 1 else "party")
            builder.add_building("row", RESIDENTIAL, [row_part(p, q, depth, profile, part, ("street", "yard", *ends))], block.street(i), 1 + 2 * u)
            builder.add_ground(rectangle((p + q) / 2 - inward * 2, inward, 4.0, 1.3), "sidewalk", "path")
            back = (p + q) / 2 + inward * (depth + 5)
            builder.add_ground(rectangle(back, along, 6.1, 9.4), ("garden", "lawn_light")[u % 2], "parcel")
            if contains(outline, back[None], 3.0)[0] and rng.random() < 0.7:
                builder.add_tree(back + inward * 2.5, "apple", 4.5, rng)


def _row_extent(outline: Points, a: Points, along: Points, inward: Points, length: float, depth: float) -> tuple[float, int]:
    """Returns the distance at which a row starts and its number of houses, such that it stays in the block and clear of the opposite row."""
    steps = np.arange(0.0, max(length, 0.1), 0.5)
    points = a + steps[:, None] * along
    free = contains(outline, points, 2.0) & contains(outline, points + inward * (depth + 9.0), 1.0)
    if not free.any():
        return 0.0, 0
    inside = steps[free]
    count = int((inside[-1] - inside[0]) / 6.4)
    return float(inside[0] + (inside[-1] - inside[0] - count * 6.4) / 2), count


def fill_slabs(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds parallel apartment slabs on a lawn."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "lawn_light", "block")
    along = unit(outline[1] - outline[0])
    if float((outline[1] - outline[0]) @ along) < float(np.hypot(*(outline[2] - outline[1]))):
        along = unit(outline[2] - outline[1])
    across = left_normal(along)
    reach = outline @ across
    middle = outline.mean(axis=0)
    for level in np.arange(reach.min() + 12, reach.max() - 10, 27.0):
        for length in (46.0, 36.0, 26.0, 20.0):
            ground = rectangle(middle + across * (level - middle @ across), along, length, 11.5)
            if contains(outline, ground, 3.0).all():
                storeys = int(rng.integers(4, 8))
                part = part_without_outline(storeys * 2.85 + 0.6, storeys, "slab", "flat")
                builder.add_building("slab", RESIDENTIAL, [flat_part(ground, part)], block.street(0), int(rng.integers(1, 60)))
                builder.add_ground(rectangle(ground.mean(axis=0) + across * 11.5, along, length, 6.0), "asphalt", "path")
                park_cars(builder, outline, ground[3] + across * 5.8, along, length, rng)
                break
    for point in random_points(outline, int(area(outline) / 200), 2.0, rng):
        if not any(
            contains(building.parts[0].front, point[None], -4.0)[0] for building in builder.plan.buildings[-4:] if len(building.parts[0].front) == 4
        ):
            builder.add_tree(point, "linden", 9.0, rng)


def fill_industry(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds a hall with a saw-tooth or low gabled roof, an office and a paved yard."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "concrete", "block")
    along = unit(outline[1] - outline[0])
    middle = outline.mean(axis=0)
    for size in (44.0, 36.0, 28.0, 20.0, 14.0):
        ground = rectangle(middle, along, size, size * 0.62)
        if contains(outline, ground, 4.0).all():
            part = part_without_outline(7.0, 1, "industrial", "metal")
            profile = saw_tooth_profile(int(size / 7), 2.4) if rng.random() < 0.55 else gable_profile(size * 0.62, 9.0)
            kind = "1080" if len(profile) > 3 else "1030"
            made = row_part(ground[0], ground[1], size * 0.62, profile, replace(part, roof_type=kind), ("street", "yard", "yard", "yard"))
            builder.add_building("industrial", INDUSTRIAL, [made], block.street(0), int(rng.integers(1, 20)))
            park_cars(builder, outline, ground[0] - left_normal(along) * 5.5, along, size, rng)
            park_cars(builder, outline, ground[3] + left_normal(along) * 6.0, along, size, rng)
            break
    for corner in range(len(outline)):
        spot = outline[corner] + unit(middle - outline[corner]) * 13.0
        office = rectangle(spot, along, 13.0, 9.0)
        if contains(outline, office, 1.0).all() and not contains(ground, office, -3.0).any():
            part = part_without_outline(9.4, 3, "slab", "flat")
            builder.add_building("office", COMMERCIAL, [flat_part(office, part)], block.street(0), int(rng.integers(1, 20)))
            break
