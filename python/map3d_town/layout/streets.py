"""Adds the ground between the blocks: streets with road markings, rows of trees, the river, fields around the town."""

import itertools

import numpy as np

from map3d_town.layout.ground_heights import DAM_HALF_M
from map3d_town.layout.layout_frame import LayoutFrame
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.polygons_2d import Points, band, circle, rectangle, unit
from map3d_town.seeds import rng

Rings = list[tuple[float, float, str]]


def lay_streets(builder: PlanBuilder, frame: LayoutFrame, rings: Rings, reach_m: float, plaza_m: float) -> None:
    """Covers the town with street surface under all other patches; continues main roads to the edge of the map."""
    old = max((outer for _, outer, kind in rings if kind == "old"), default=plaza_m)
    builder.add_ground(frame.warp(circle(np.zeros(2), reach_m - 1.0, 96)), "asphalt", "town")
    builder.add_ground(frame.warp(circle(np.zeros(2), old - 1.5, 72)), "cobble", "town")
    for angle in frame.roads:
        _lay_main_road(builder, frame, angle, old, reach_m, rings)
    for inner, _, kind in rings:
        if kind in ("perimeter", "outer") or inner > old:
            _mark_ring_street(builder, frame, inner)


def _lay_main_road(builder: PlanBuilder, frame: LayoutFrame, angle: float, old: float, reach_m: float, rings: Rings) -> None:
    direction = np.array([np.cos(angle), np.sin(angle)])
    start = _lay_dam(builder, frame, direction, old)
    line = frame.warp(np.arange(start, reach_m * 1.6 + 240, 8.0)[:, None] * direction)
    for quad in band(line, 9.0):
        builder.add_ground(quad, "asphalt", "bridge")
    for number, quad in enumerate(band(frame.warp(np.arange(start + 3, reach_m * 1.6 + 240, 3.0)[:, None] * direction), 0.16)):
        if number % 3 == 0:
            builder.add_ground(quad, "mark", "mark")
    source = rng(frame.seed, "alley", int(angle * 1000))
    for distance in np.arange(old + 12, reach_m - 4, 10.5):
        if any(abs(distance - inner) < 11 for inner, _, _ in rings) or is_near_river(frame, direction * distance):
            continue
        here, ahead = frame.warp(np.array([direction * distance, direction * (distance + 1)]))
        across = unit(ahead - here)[::-1] * np.array([-1.0, 1.0])
        for side in (-1, 1):
            builder.add_tree(here + across * (5.8 * side), "linden", 8.5, source)
    for inner, _, _ in rings:
        if inner >= old:
            _lay_zebra_crossing(builder, frame, direction, inner + 8.5)


def _lay_dam(builder: PlanBuilder, frame: LayoutFrame, direction: Points, old: float) -> float:
    """Adds the dam where a main road crosses the river. Returns the distance at which the carriageway starts: at the old town or before the river."""
    crossing = _crossing_m(frame, direction)
    if crossing is None:
        return old
    reach = (frame.river_half_m + 8.0) / abs(direction[1])
    for quad in band(frame.warp(np.linspace(crossing - reach, crossing + reach, 9)[:, None] * direction), 2 * DAM_HALF_M):
        builder.add_ground(quad, "concrete", "bridge")
    return float(min(old, crossing - reach))


def _crossing_m(frame: LayoutFrame, direction: Points) -> float | None:
    """Returns the distance from the centre at which a main road crosses the river, or None."""
    if direction[1] * frame.river_y <= 0 or abs(direction[1]) < 0.2:
        return None
    return float(frame.river_y / direction[1])


def is_near_river(frame: LayoutFrame, plain: Points) -> bool:
    """Returns whether a point in layout coordinates is in the river or on its banks."""
    return bool(abs(plain[1] - frame.river_y) < frame.river_half_m + 7)


def _lay_zebra_crossing(builder: PlanBuilder, frame: LayoutFrame, direction: Points, distance: float) -> None:
    """Adds a zebra crossing across a main road."""
    if is_near_river(frame, direction * distance):
        return
    here, ahead = frame.warp(np.array([direction * distance, direction * (distance + 1)]))
    along = unit(ahead - here)
    across = np.array([-along[1], along[0]])
    for offset in np.arange(-4.0, 4.1, 1.0):
        builder.add_ground(rectangle(here + across * offset, along, 3.2, 0.5), "mark", "mark")


def _mark_ring_street(builder: PlanBuilder, frame: LayoutFrame, radius: float) -> None:
    count = int(2 * np.pi * radius / 3.0)
    angles = np.linspace(0, 2 * np.pi, count)
    roads = np.array(frame.roads)
    line = frame.warp(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    gaps = np.abs((angles[:, None] - roads + np.pi) % (2 * np.pi) - np.pi).min(axis=1) * radius
    for number, quad in list(enumerate(band(line, 0.14)))[::3]:
        wet = is_near_river(frame, radius * np.array([np.cos(angles[number]), np.sin(angles[number])]))
        if gaps[number] > 9 and not wet:
            builder.add_ground(quad, "mark", "mark")


def river_line(frame: LayoutFrame, reach_m: float) -> Points:
    """Returns the river's centre line from west to east, far beyond the map, in town coordinates."""
    x = np.arange(-(reach_m * 2 + 600), reach_m * 2 + 601, 12.0)
    return frame.warp(np.stack([x, np.full(len(x), frame.river_y)], axis=1))


def river_crossings(frame: LayoutFrame) -> tuple[tuple[float, float, float, float], ...]:
    """Returns (x, y, unit x, unit y) in town coordinates for each main road that crosses the river: the crossing and the road's direction."""
    found = []
    for angle in frame.roads:
        direction = np.array([np.cos(angle), np.sin(angle)])
        crossing = _crossing_m(frame, direction)
        if crossing is None:
            continue
        plain = direction * crossing
        here, ahead = frame.warp(np.array([plain, plain + direction]))
        along = unit(ahead - here)
        found.append((float(here[0]), float(here[1]), float(along[0]), float(along[1])))
    return tuple(found)


def lay_river(builder: PlanBuilder, frame: LayoutFrame, reach_m: float) -> None:
    line = river_line(frame, reach_m)
    half = frame.river_half_m
    for material, order, width in (("bank", "bank", 2 * half + 13), ("water", "water", 2 * half)):
        for quad in band(line, width):
            builder.add_ground(quad, material, order)
        for point in line:
            builder.add_ground(circle(point, width / 2, 16), material, order)
    source = rng(frame.seed, "river")
    for point, ahead in zip(line[:-1:2], line[1::2], strict=False):
        across = unit(ahead - point)[::-1] * np.array([-1.0, 1.0])
        if np.hypot(*point) < reach_m * 1.2 + 60 and _is_far_from_roads(frame, point, 14):
            builder.add_tree(point + across * (half + 4.5) * source.choice([-1, 1]), "poplar", 12.0, source)


def _is_far_from_roads(frame: LayoutFrame, point: Points, least_m: float) -> bool:
    for angle in frame.roads:
        direction = np.array([np.cos(angle), np.sin(angle)])
        line = frame.warp(np.arange(0, 3000, 10.0)[:, None] * direction)
        if np.hypot(*(line - point).T).min() < least_m:
            return False
    return True


def lay_fields(builder: PlanBuilder, frame: LayoutFrame, reach_m: float) -> None:
    """Adds strips of fields, meadows and groves below all other patches."""
    source = rng(frame.seed, "fields")
    radius, size = builder.plan.radius_m, 110.0
    for x in np.arange(-radius, radius, size):
        for y in np.arange(-radius, radius, size):
            corner = np.array([[x, y], [x + size, y], [x + size, y + size], [x, y + size]])
            cuts = np.sort(source.uniform(0.2, 0.8, 2))
            edges = [0.0, *cuts, 1.0]
            for a, b in itertools.pairwise(edges):
                strip = corner[0] + (corner - corner[0]) * [1.0, 0.0] + np.array([[0, a], [0, a], [0, b], [0, b]]) * size
                material = ("meadow", "field_green", "field_gold", "field_brown", "meadow")[int(source.integers(5))]
                builder.add_ground(frame.warp(strip), material, "field")
            _plant_grove(builder, frame, corner.mean(axis=0), reach_m, radius, source)


def _plant_grove(builder: PlanBuilder, frame: LayoutFrame, middle: Points, reach_m: float, radius: float, source: np.random.Generator) -> None:
    if np.hypot(*middle) < reach_m + 60 or source.random() > 0.3:
        return
    centre = frame.warp(middle)[0]
    if (
        not _is_far_from_roads(frame, centre, 45)
        or is_near_river(frame, middle - np.array([0, 30]))
        or is_near_river(frame, middle + np.array([0, 30]))
    ):
        return
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ragged = 30 * (1 + 0.16 * np.sin(2 * angle + source.uniform(0, 6)) + 0.1 * np.sin(5 * angle + source.uniform(0, 6)))
    builder.add_ground(centre + ragged[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1), "forest", "forest")
    for angle, distance in source.uniform([0, 0], [2 * np.pi, 1], (26, 2)):
        point = centre + np.sqrt(distance) * 27 * np.array([np.cos(angle), np.sin(angle)])
        if np.abs(point).max() < radius - 4:
            builder.add_tree(point, ("fir", "linden", "fir")[int(source.integers(3))], 12.0, source)
