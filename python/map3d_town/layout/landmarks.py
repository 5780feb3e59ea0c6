"""Adds the landmarks of a European town: the market square with its church, and the town hall."""

from dataclasses import replace

import numpy as np

from map3d_town.layout.city_blocks import CityBlock
from map3d_town.layout.massing import HIP, flat_part, gable_profile, part_without_outline, ring_part, row_part, spire_part
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.layout.town_plan import BuildingPart
from map3d_town.polygons_2d import Points, area, circle, keeps_its_edges, left_normal, offset, rectangle, unit

CHURCH, TOWN_HALL, MONUMENT = "31001_3041", "31001_3012", ""


def add_market_square(builder: PlanBuilder, outline: Points, rng: np.random.Generator) -> None:
    """Adds the paved square with church, fountain and trees."""
    builder.add_ground(outline, "plaza", "block")
    angle = float(rng.uniform(-0.5, 0.5))
    along = np.array([np.cos(angle), np.sin(angle)])
    centre = outline.mean(axis=0)
    middle = centre + np.array([2.0, 9.0])
    _add_church(builder, middle, along)
    fountain = centre + np.array([-4.0, -16.0]) + rng.uniform(-3, 3, 2)
    basin = circle(fountain, 3.6, 12)
    part = replace(part_without_outline(0.7, 1, "wall", "paving"), sides=("blank",) * 12)
    column = ("column", (float(fountain[0]), float(fountain[1]), 0.5, 0.0, 4.5))
    builder.add_building("monument", MONUMENT, [flat_part(basin, part, 0.3)], "Marktplatz", 2, (column,))
    builder.add_ground(circle(fountain, 3.1, 20), "water", "roof")
    for at in ((18.0, -16.0), (22.0, -10.0), (-24.0, -8.0), (-22.0, -15.0)):
        builder.add_tree(centre + np.array(at), "linden", 8.0, rng)


def _add_church(builder: PlanBuilder, middle: Points, along: Points) -> None:
    """Adds a church: a nave with aisles, a choir, and a western tower with a tall spire."""
    across = left_normal(along)
    nave = rectangle(middle, along, 24.0, 9.0)
    side = ("street", "street", "blank", "blank")
    parts = [
        row_part(nave[0], nave[1], 9.0, gable_profile(9.0, 55), _stone_part(12.5, 2, "slate", 0.35), side),
        row_part(*_aisle_eave(middle - across * 6.6, along), 4.2, ((0.0, 0.0), (1.0, 2.4)), _stone_part(6.0, 1, "slate", 0.3), side),
        row_part(*_aisle_eave(middle + across * 6.6, -along), 4.2, ((0.0, 0.0), (1.0, 2.4)), _stone_part(6.0, 1, "slate", 0.3), side),
    ]
    tower = rectangle(middle - along * 15.5, along, 7.6, 7.6)
    spire = ((0.0, 0.0), (0.25, 4.2), (1.0, 24.0))
    parts.append(spire_part(tower, spire, replace(_stone_part(27.0, 4, "copper", 0.4), sides=("street",) * 4)))
    choir = circle(middle + along * 12.0, 4.6, 8, float(np.arctan2(along[1], along[0])) + np.pi / 8)
    parts.append(spire_part(choir, ((0.0, 0.0), (1.0, 5.5)), replace(_stone_part(10.0, 1, "slate", 0.3), sides=("street",) * 8)))
    builder.add_building("church", CHURCH, parts, "Marktplatz", 1)


def _aisle_eave(centre: Points, along: Points) -> tuple[Points, Points]:
    line = rectangle(centre, along, 22.0, 4.2)
    return line[0], line[1]


def _stone_part(eave_m: float, storeys: int, cover: str, overhang_m: float) -> BuildingPart:
    return part_without_outline(eave_m, storeys, "church", cover, overhang_m)


def add_town_hall(builder: PlanBuilder, block: CityBlock) -> bool:
    """Adds a town hall around a courtyard, with a clock tower on the market side. Returns False when the block is too small."""
    outline, depth = block.outline, 10.5
    inner = offset(outline, depth)
    if not keeps_its_edges(outline, inner, 3.0) or area(inner) < 30:
        return False
    builder.add_ground(outline, "plaza", "block")
    wings = ring_part(outline, depth, gable_profile(depth, 46), replace(part_without_outline(11.5, 3, "townhall", "tiles", 0.45), roof_type=HIP))
    sides = [(outline[i] + outline[(i + 1) % len(outline)]) / 2 for i in range(len(outline))]
    near = min(range(len(sides)), key=lambda i: float(np.hypot(*sides[i])))
    along = unit(outline[(near + 1) % len(outline)] - outline[near])
    tower = rectangle(sides[near] + left_normal(along) * 2.6, along, 6.4, 6.4)
    clock = replace(part_without_outline(24.0, 6, "townhall", "copper", 0.4), sides=("street",) * 4)
    builder.add_building(
        "townhall", TOWN_HALL, [wings, spire_part(tower, ((0.0, 0.0), (0.4, 3.0), (0.55, 5.5), (1.0, 13.0)), clock)], "Marktplatz", 3
    )
    return True
