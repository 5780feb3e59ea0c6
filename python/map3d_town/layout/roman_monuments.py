"""Adds the public buildings of a Roman town: forum with temple and basilica, theatre, amphitheatre, baths, market."""

from dataclasses import replace

import numpy as np

from map3d_town.layout.massing import dome_profile, gable_profile, part_without_outline, ring_part, row_part, spire_part, vault_profile
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.layout.roman_houses import place_columns
from map3d_town.layout.town_plan import BuildingPart
from map3d_town.polygons_2d import Points, circle, left_normal, offset, rectangle, unit

PUBLIC, SACRED = "31001_3010", "31001_3040"


def podium_part(outline: Points, height_m: float, facade_kind: str, cover: str) -> BuildingPart:
    """Returns a block with a flat top, such as a podium."""
    part = replace(part_without_outline(height_m, 1, facade_kind, cover, roof_type="1000"), sides=("blank",) * len(outline))
    return replace(part, front=outline, back=offset(outline, 0.6), profile=((0.0, 0.0), (1.0, 0.0)), closed=True)


def steps_part(a: Points, b: Points, depth_m: float, rise_m: float, count: int, facade_kind: str) -> BuildingPart:
    """Returns stairs that rise inward from the line a–b."""
    profile: list[tuple[float, float]] = [(0.0, rise_m / count)]
    for i in range(1, count):
        profile += [(i / count, rise_m * i / count), (i / count, rise_m * (i + 1) / count)]
    profile.append((1.0, rise_m))
    part = part_without_outline(0.0, 1, facade_kind, "paving", roof_type="1000")
    return row_part(a, b, depth_m, tuple(profile), part, ("blank",) * 4)


def add_temple(builder: PlanBuilder, middle: Points, along: Points, size: tuple[float, float]) -> None:
    """Adds a temple on a podium, with stairs at its front (towards `along`) and columns around it."""
    length, width = size
    podium = rectangle(middle, along, length, width)
    right = podium[1], podium[2]
    stairs = steps_part(right[0] + along * 5.0, right[1] + along * 5.0, 5.0, 3.0, 8, "temple")
    cella = rectangle(middle - along * length * 0.1, along, length * 0.66, width * 0.56)
    roof = rectangle(middle, along, length - 0.6, width - 0.6)
    columns = offset(podium, 1.1)
    ring = [(columns[i], columns[(i + 1) % 4]) for i in range(4)]
    hall = replace(part_without_outline(11.0, 1, "temple", "paving", roof_type="1000"), sides=("blank",) * 4)
    hall = replace(hall, front=cella, back=offset(cella, 0.6), profile=((0.0, 0.0), (1.0, 0.0)), closed=True)
    lid = replace(part_without_outline(12.4, 1, "temple", "roman", 0.5), lift_m=11.0)
    pediment = row_part(roof[0], roof[1], width - 0.6, gable_profile(width - 0.6, 17), lid, ("blank",) * 4)
    builder.add_building(
        "temple",
        SACRED,
        [podium_part(podium, 3.0, "temple", "paving"), stairs, hall, pediment],
        "Forum",
        1,
        place_columns(ring, 3.1, 0.48, 3.0, 11.0),
    )


def add_forum(builder: PlanBuilder, outline: Points, along: Points, rng: np.random.Generator) -> None:
    """Adds a paved square between temple (west) and basilica (east), with colonnades on the long sides and statues."""
    builder.add_ground(outline, "plaza", "block")
    across, middle = left_normal(along), outline.mean(axis=0)
    length, width = float(np.hypot(*(outline[1] - outline[0]))), float(np.hypot(*(outline[3] - outline[0])))
    add_temple(builder, middle - along * (length / 2 - 20), along, (27.0, 16.5))
    _add_basilica(builder, middle + along * (length / 2 - 12), across, width - 6)
    for sign in (-1, 1):
        a = middle - along * (length / 2 - 1) * sign - across * (width / 2 - 0.8) * sign
        b = a + along * (length - 26) * sign
        if sign < 0:
            a, b = a - along * 25, b - along * 25
        _add_colonnade(builder, a, b)
    for t in (-8.0, 2.0, 12.0):
        for side in (-9.0, 9.0):
            spot = middle + along * t + across * side
            base = rectangle(spot, along, 1.8, 1.8)
            statue = ("column", (float(spot[0]), float(spot[1]), 0.32, 1.6, 4.0))
            builder.add_building("monument", "", [podium_part(base, 1.6, "temple", "paving")], "Forum", 9, (statue,))


def _add_colonnade(builder: PlanBuilder, a: Points, b: Points) -> None:
    """Adds a hall that is open to the left: a back wall on the line a–b, columns, and a pitched roof."""
    inward = left_normal(unit(b - a))
    wall = row_part(a, b, 0.6, ((0.0, 0.0), (1.0, 0.0)), part_without_outline(5.0, 1, "roman", "paving", roof_type="1000"), ("blank",) * 4)
    lid = replace(part_without_outline(5.4, 1, "temple", "roman", 0.4), lift_m=5.0)
    roof = row_part(a, b, 6.0, gable_profile(6.0, 20), lid, ("blank",) * 4)
    line = [(a + inward * 5.5, b + inward * 5.5)]
    builder.add_building("stoa", PUBLIC, [wall, roof], "Forum", 5, place_columns(line, 3.2, 0.34, -0.4, 5.0))


def _add_basilica(builder: PlanBuilder, middle: Points, along: Points, length: float) -> None:
    """Adds a basilica: a high nave with windows above lower aisles."""
    nave = rectangle(middle, along, length - 6, 9.0)
    parts = [
        row_part(
            nave[0],
            nave[1],
            9.0,
            gable_profile(9.0, 24),
            part_without_outline(14.0, 3, "baths", "roman", 0.5),
            ("street", "street", "street", "street"),
        )
    ]
    for sign in (-1.0, 1.0):
        line = rectangle(middle - left_normal(along) * (7.2 * sign), along * sign, length - 6, 5.4)
        part = part_without_outline(7.5, 2, "baths", "roman", 0.4, roof_type="1010")
        parts.append(row_part(line[0], line[1], 5.4, ((0.0, 0.0), (1.0, 2.2)), part, ("street", "blank", "blank", "blank")))
    apse = circle(middle + along * (length / 2 - 3), 4.2, 12)
    parts.append(spire_part(apse, ((0.0, 0.0), (1.0, 2.4)), replace(part_without_outline(9.0, 2, "baths", "roman", 0.3), sides=("street",) * 12)))
    builder.add_building("basilica", PUBLIC, parts, "Forum", 2)


def seating_profile(depth_rows: int, fall_m: float) -> tuple[tuple[float, float], ...]:
    """Returns the profile of a cavea: a rim wall, then rows of seats down towards the stage; heights are relative to the rim."""
    profile: list[tuple[float, float]] = [(0.0, 0.0), (0.05, 0.0), (0.05, -1.0)]
    for i in range(depth_rows):
        t, h = 0.05 + 0.95 * (i + 1) / depth_rows, -1.0 - fall_m * (i + 1) / depth_rows
        profile += [(t, profile[-1][1])] if i == depth_rows - 1 else [(t, profile[-1][1]), (t, h)]
    return tuple(profile)


def add_theatre(builder: PlanBuilder, outline: Points, facing: Points, rng: np.random.Generator) -> None:
    """Adds a theatre: a semicircle of seats with arcades outside, the orchestra, a stage building with columns."""
    builder.add_ground(outline, "sand", "block")
    middle = outline.mean(axis=0) + facing * 12.0
    start = np.arctan2(facing[1], facing[0]) + np.pi / 2
    angle = start + np.linspace(0, np.pi, 19)
    spokes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    part = replace(part_without_outline(15.0, 3, "arena", "seats", roof_type="1000"), closed=False)
    cavea = replace(
        part, front=middle + 38 * spokes, back=middle + 12 * spokes, profile=seating_profile(18, 12.4), sides=("street",) * 18 + ("blank",) * 20
    )
    side = np.array([-facing[1], facing[0]])
    stage = rectangle(middle + facing * 9.5, side, 62.0, 7.0)
    house = row_part(
        stage[0],
        stage[1],
        7.0,
        ((0.0, 0.0), (1.0, 2.2)),
        part_without_outline(15.0, 3, "arena", "roman", 0.4),
        ("street", "street", "blank", "blank"),
    )
    boards = podium_part(rectangle(middle + facing * 3.9, side, 34.0, 4.0), 1.3, "roman", "paving")
    row = middle + facing * 5.2
    pillars = place_columns([(row - side * 15, row + side * 15)], 3.0, 0.4, 1.3, 11.0)
    builder.add_building("theatre", "31001_3032", [cavea, house, boards], "Via Sacra", 1, pillars)
    builder.add_ground(middle + 11.8 * np.concatenate([spokes, [[0, 0]]]), "plaza", "roof")


def add_amphitheatre(builder: PlanBuilder, middle: Points, rng: np.random.Generator) -> None:
    """Adds an oval of seats around an arena."""
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    oval = middle + np.stack([46 * np.cos(angle), 37 * np.sin(angle)], axis=1)
    builder.add_ground(middle + (oval - middle) * 1.2, "sand", "block")
    part = part_without_outline(16.0, 3, "arena", "seats", roof_type="1000")
    made = replace(ring_part(oval, 19.0, seating_profile(14, 12.0), part), sides=("street",) * 36 + ("blank",) * 36)
    if builder.add_building("amphitheatre", "31001_3032", [made], "Via Appia", 1):
        builder.add_ground(made.back, "sand", "roof")


def add_baths(builder: PlanBuilder, outline: Points, along: Points, rng: np.random.Generator) -> None:
    """Adds baths: vaulted halls, a domed hot bath, and an exercise court with a pool."""
    builder.add_ground(outline, "plaza", "block")
    across, middle = left_normal(along), outline.mean(axis=0)
    width = float(np.hypot(*(outline[1] - outline[0])))
    parts = []
    for k, (shift, depth) in enumerate(((6.0, 10.0), (17.0, 11.0))):
        hall = rectangle(middle + across * shift, along, width - 12, depth)
        hall_part = part_without_outline(7.0 + k, 2, "baths", "paving", 0.0, roof_type="1120")
        parts.append(row_part(hall[0], hall[1], depth, vault_profile(depth * 0.36), hall_part, ("street", "street", "street", "street")))
    hot = circle(middle + across * 17 + along * 3, 6.6, 16)
    parts.append(spire_part(hot, dome_profile(6.0), replace(part_without_outline(10.5, 3, "baths", "paving", 0.0), sides=("street",) * 16)))
    _lay_courts = rectangle(middle - across * 15, along, width - 8, 26.0)
    walk = replace(ring_part(_lay_courts, 4.0, gable_profile(4.0, 20), part_without_outline(4.4, 1, "roman", "roman", 0.3)), lift_m=4.0)
    parts.append(replace(walk, sides=("blank",) * 8))
    line = offset(_lay_courts, 3.6)
    pillars = place_columns([(line[i], line[(i + 1) % 4]) for i in range(4)], 3.0, 0.28, -0.4, 4.0)
    builder.add_building("baths", PUBLIC, parts, "Via Latina", 1, pillars)
    builder.add_ground(rectangle(middle - across * 15, along, 16.0, 8.5), "water", "thing")


def add_macellum(builder: PlanBuilder, outline: Points, along: Points, rng: np.random.Generator) -> None:
    """Adds a market: shops around a court with a round hall in its centre."""
    builder.add_ground(outline, "plaza", "block")
    ground = offset(outline, 3.0)
    _add_shops = ring_part(ground, 6.5, gable_profile(6.5, 22), part_without_outline(5.2, 1, "roman", "roman", 0.35))
    middle = ground.mean(axis=0)
    tholos = circle(middle, 6.0, 16)
    lid = replace(part_without_outline(6.0, 1, "temple", "roman", 0.4), lift_m=5.2, sides=("blank",) * 16)
    pillars = tuple(("column", (float(x), float(y), 0.32, -0.4, 5.2)) for x, y in circle(middle, 5.4, 12))
    builder.add_building("macellum", "31001_2053", [_add_shops, spire_part(tholos, ((0.0, 0.0), (1.0, 2.6)), lid)], "Via Sacra", 2, pillars)
