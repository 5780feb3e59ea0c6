"""Adds Roman houses: atrium and peristyle, shops along the street, porticoes."""

from dataclasses import replace

import numpy as np

from map3d_town.layout.city_blocks import CityBlock
from map3d_town.layout.massing import gable_profile, part_without_outline, ring_part, row_part
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.polygons_2d import Points, left_normal, offset, unit

PlannedInstallations = tuple[tuple[str, tuple[float, ...]], ...]
HOUSE, SHOP = "31001_1010", "31001_2050"
SHOPS_DEEP_M = 5.0


def place_columns(line: list[tuple[Points, Points]], step_m: float, radius_m: float, low: float, high: float) -> PlannedInstallations:
    """Returns evenly spaced columns along lines."""
    out = []
    for a, b in line:
        length = float(np.hypot(*(b - a)))
        count = max(2, round(length / step_m) + 1)
        for t in np.linspace(0.3 / length, 1 - 0.3 / length, count):
            x, y = a + (b - a) * t
            out.append(("column", (float(x), float(y), radius_m, low, high)))
    return tuple(out)


def add_portico(builder: PlanBuilder, a: Points, b: Points, depth_m: float, rng: np.random.Generator) -> None:
    """Adds a walkway under a lean-to roof on columns along a street from a to b."""
    part = replace(part_without_outline(3.9, 1, "roman", "roman", 0.3, roof_type="1010"), lift_m=3.5)
    made = row_part(a, b, depth_m, ((0.0, 0.0), (1.0, 1.0)), part, ("blank", "blank", "blank", "blank"))
    inward = left_normal(unit(b - a)) * 0.35
    builder.add_building("portico", SHOP, [made], installations=place_columns([(a + inward, b + inward)], 3.4, 0.27, -0.4, 3.5))


def fill_domus(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds shops along the two short sides, and two or three houses between them."""
    rng, (a, b, c, d) = block.rng, block.outline
    builder.add_ground(block.outline, "yard", "block")
    _add_shops(builder, block, a, b, 0)
    _add_shops(builder, block, c, d, 2)
    up = unit(d - a)
    a, b, c, d = a + up * SHOPS_DEEP_M, b + up * SHOPS_DEEP_M, c - up * SHOPS_DEEP_M, d - up * SHOPS_DEEP_M
    length = float(np.hypot(*(d - a)))
    count = 2 if length < 54 else 3
    cuts = np.concatenate([[0.0], np.cumsum(rng.uniform(0.8, 1.2, count))])
    cuts = cuts / cuts[-1] * length
    for i in range(count):
        low, high = cuts[i], cuts[i + 1]
        outline = np.array([a + up * low, b + up * low, b + up * high, a + up * high])
        _add_house(builder, outline if rng.random() < 0.5 else np.roll(outline, 2, axis=0), block, i)


def _add_shops(builder: PlanBuilder, block: CityBlock, a: Points, b: Points, edge: int) -> None:
    """Adds a row of shops (tabernae) of one or two storeys."""
    rng, length, along = block.rng, float(np.hypot(*(b - a))), unit(b - a)
    count = max(2, int(length / 9))
    for i in range(count):
        p, q = a + along * (length * i / count), a + along * (length * (i + 1) / count)
        storeys = int(rng.integers(1, 3))
        part = part_without_outline(3.4 * storeys + 0.4, storeys, "roman", "roman", 0.35)
        ends = ("yard" if i == 0 else "party", "yard" if i == count - 1 else "party")
        builder.add_building(
            "taberna",
            SHOP,
            [row_part(p, q, SHOPS_DEEP_M, gable_profile(SHOPS_DEEP_M, 22), part, ("shop", "blank", *ends))],
            block.street(edge),
            i + 1,
        )


def _add_house(builder: PlanBuilder, outline: Points, block: CityBlock, number: int) -> None:
    """Adds a house: an atrium with inward roofs in front, behind it rooms and a colonnade around a garden."""
    rng, (a, b, c, d) = block.rng, outline
    share = float(rng.uniform(0.4, 0.46))
    front = np.array([a, a + (b - a) * share, d + (c - d) * share, d])
    rear = np.array([front[1], b, c, front[2]])
    width = float(np.hypot(*(d - a)))
    depth = min(6.0, width * 0.33, float(np.hypot(*(b - a))) * share * 0.36)
    sides = ("party",) * 4 + ("yard",) * 4
    atrium = ring_part(front, depth, ((0.0, 1.9), (1.0, 0.0)), part_without_outline(4.2, 1, "roman", "roman", 0.3, roof_type="1010"))
    rooms = ring_part(rear, 4.6, gable_profile(4.6, 22), part_without_outline(4.6, 1, "roman", "roman", 0.2))
    atrium, rooms = (replace(p, sides=("street", *sides[1:])) for p in (atrium, rooms))
    inside = offset(rear, 4.6)
    walk = replace(
        ring_part(inside, 2.6, ((0.0, 0.9), (1.0, 0.0)), part_without_outline(3.3, 1, "roman", "roman", 0.3, roof_type="1010")), lift_m=2.95
    )
    walk = replace(walk, sides=("blank",) * 8)
    line = offset(inside, 2.3)
    pillars = place_columns([(line[i], line[(i + 1) % 4]) for i in range(4)], 2.7, 0.2, -0.3, 2.95)
    builder.add_building("domus", HOUSE, [atrium, rooms, walk], block.street(1), number + 1, pillars)
    _lay_courts(builder, offset(front, depth), offset(inside, 2.6), rng)


def _lay_courts(builder: PlanBuilder, atrium: Points, garden: Points, rng: np.random.Generator) -> None:
    """Adds the basin of the atrium, and garden beds, a fountain and trees in the peristyle."""
    builder.add_ground(atrium, "plaza", "parcel")
    middle = atrium.mean(axis=0)
    builder.add_ground(middle + (atrium - middle) * 0.5, "water", "thing")
    builder.add_ground(garden, "garden", "parcel")
    middle = garden.mean(axis=0)
    builder.add_ground(middle + (garden - middle) * 0.34, "gravel", "path")
    builder.add_ground(middle + (garden - middle) * 0.2, "water", "thing")
    for corner in garden:
        builder.add_tree(middle + (corner - middle) * 0.66, ("cypress", "olive", "cypress")[int(rng.integers(3))], 5.5, rng)
