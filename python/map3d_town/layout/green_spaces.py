"""Fills blocks without houses: parks, orchards, sports grounds, allotments, meadows."""

import itertools

import numpy as np

from map3d_town.layout.city_blocks import CityBlock, add_shed, random_points
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.polygons_2d import Points, area, contains, inset, left_normal, offset, rectangle, unit


def fill_park(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds a lawn with a path around it and a winding one across, many trees, and a pond if it is large."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "lawn", "block")
    middle, size = outline.mean(axis=0), float(np.sqrt(area(outline)))
    walk = inset(outline, 4.0)
    if len(walk) >= 3 and area(walk) > 250:
        builder.add_ground(walk, "gravel", "path")
        builder.add_ground(inset(walk, 2.2), "lawn_light", "path")
    pond = area(outline) > 2200
    add_winding_path(builder, outline, rng)
    if pond:
        angle = np.linspace(0, 2 * np.pi, 28, endpoint=False)
        reach = size * 0.14 * (1 + 0.16 * np.sin(3 * angle + rng.uniform(0, 6)) + 0.1 * np.sin(2 * angle))
        shore = np.stack([np.cos(angle) * 1.3, np.sin(angle)], axis=1)
        builder.add_ground(middle + (reach + 1.2)[:, None] * shore, "gravel", "thing")
        builder.add_ground(middle + reach[:, None] * shore, "water", "thing")
    for point in random_points(outline, int(area(outline) / 85), 1.5, rng):
        if not pond or np.hypot(*(point - middle)) > size * 0.23:
            builder.add_tree(point, ("linden", "chestnut", "fir", "linden")[int(rng.integers(4))], float(rng.uniform(8, 13)), rng)


def add_winding_path(builder: PlanBuilder, outline: Points, rng: np.random.Generator) -> None:
    """Adds a winding path between the midpoints of two opposite edges."""
    n = len(outline)
    first = int(rng.integers(n))
    a = (outline[first] + outline[(first + 1) % n]) / 2
    other = (first + n // 2) % n
    b = (outline[other] + outline[(other + 1) % n]) / 2
    t = np.linspace(0, 1, 15)
    sway = np.sin(t * 2 * np.pi) * np.hypot(*(b - a)) * 0.07
    line = a + (b - a) * t[:, None] + left_normal(unit(b - a)) * sway[:, None]
    for start, end in itertools.pairwise(line):
        length = float(np.hypot(*(end - start)))
        builder.add_ground(rectangle((start + end) / 2, unit(end - start), length + 1.2, 2.2), "gravel", "path")


def fill_orchard(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds rows of fruit trees on a meadow."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "meadow", "block")
    for point in grid_points(outline, 8.0, 3.0):
        if rng.random() < 0.85:
            builder.add_tree(point + rng.normal(0, 0.4, 2), "apple", 4.8, rng)


def grid_points(outline: Points, step_m: float, margin_m: float) -> Points:
    """Returns the points of a grid along the first edge that are inside the outline."""
    along = unit(outline[1] - outline[0])
    axes = np.array([along, left_normal(along)])
    reach = outline @ axes.T
    low, high = reach.min(axis=0), reach.max(axis=0)
    u, v = np.meshgrid(np.arange(low[0], high[0], step_m), np.arange(low[1], high[1], step_m))
    points = np.stack([u.ravel(), v.ravel()], axis=1) @ axes
    return np.asarray(points[contains(outline, points, margin_m)])


def fill_sports(builder: PlanBuilder, block: CityBlock) -> bool:
    """Adds a football pitch with trees around it. Returns False when the block is too small."""
    rng, outline = block.rng, block.outline
    first = unit(outline[2] - outline[1])
    for along in (first, left_normal(first), unit(outline[1] - outline[0])):
        for length in (62.0, 52.0, 44.0):
            pitch = rectangle(outline.mean(axis=0), along, length, length * 0.62)
            if contains(outline, pitch, 2.5).all():
                builder.add_ground(outline, "lawn", "block")
                draw_pitch(builder, pitch)
                for point in random_points(outline, int(area(outline) / 130), 1.0, rng):
                    if not contains(pitch, point[None], -3.0)[0]:
                        builder.add_tree(point, "linden", 8.0, rng)
                return True
    return False


def draw_pitch(builder: PlanBuilder, pitch: Points) -> None:
    """Adds the lines of a pitch: outer lines, halfway line, centre circle, penalty areas."""
    a, b, _, d = pitch
    along, across, middle = unit(b - a), unit(d - a), pitch.mean(axis=0)
    length, width = float(np.hypot(*(b - a))), float(np.hypot(*(d - a)))

    def add_outline(centre: Points, u: float, v: float, material: str = "lawn_light") -> None:
        builder.add_ground(rectangle(centre, along, u, v), "mark", "path")
        builder.add_ground(rectangle(centre, along, u - 0.3, v - 0.3), material, "path")

    add_outline(middle, length, width)
    for sign in (-1, 1):
        add_outline(middle + along * sign * (length / 2 - 5.5), 11.0, width * 0.55)
    ring = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    for radius, material in ((6.2, "mark"), (5.9, "lawn_light")):
        builder.add_ground(middle + radius * (np.cos(ring)[:, None] * along + np.sin(ring)[:, None] * across), material, "path")
    builder.add_ground(rectangle(middle, along, 0.25, width), "mark", "path")


def fill_allotments(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds small gardens with huts, beds and fruit trees."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "lawn", "block")
    along = unit(outline[1] - outline[0])
    for number, point in enumerate(grid_points(outline, 12.0, 6.5)):
        plot = rectangle(point, along, 11.0, 11.0)
        builder.add_ground(plot, ("garden", "lawn", "lawn_light", "field_green")[int(rng.integers(4))], "parcel")
        builder.add_ground(rectangle(point + along * 2.6, along, 3.6, 8.0), "field_brown", "parcel")
        if not builder.is_full and number % 2 == 0:
            add_shed(builder, rectangle(point - along * 2.6, along, 3.6, 2.8), rng)
        if rng.random() < 0.7:
            builder.add_tree(point + left_normal(along) * 4.5, "apple", 4.0, rng)


def fill_meadow(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds a meadow with a few trees."""
    builder.add_ground(block.outline, "meadow", "block")
    for point in random_points(block.outline, int(area(block.outline) / 420), 2.0, block.rng):
        builder.add_tree(point, ("linden", "apple", "chestnut")[int(block.rng.integers(3))], 8.0, block.rng)


def fill_green(builder: PlanBuilder, block: CityBlock) -> None:
    """Fills the block with a random kind of green space."""
    choice = block.rng.random()
    if area(block.outline) < 700 or choice < 0.3:
        fill_park(builder, block)
    elif choice < 0.5 and fill_sports(builder, block):
        return
    elif choice < 0.72:
        fill_orchard(builder, block)
    elif choice < 0.86:
        fill_allotments(builder, block)
    else:
        fill_meadow(builder, block)


def fill_belt(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds a piece of the green belt on the former town wall: lawn, a path along its middle, rows of trees."""
    rng, outline = block.rng, block.outline
    builder.add_ground(outline, "lawn", "block")
    edges = np.roll(outline, -1, axis=0) - outline
    along = unit(edges[int(np.argmax(np.hypot(edges[:, 0], edges[:, 1])))])
    middle, across = outline.mean(axis=0), left_normal(along)
    spots = middle + np.arange(-90.0, 90.0, 2.0)[:, None] * along
    inside = spots[contains(outline, spots, 1.5)]
    for point in inside:
        builder.add_ground(rectangle(point, along, 2.3, 3.0), "gravel", "path")
    for point in inside[::4]:
        for side in (-3.7, 3.7):
            if contains(outline, (point + across * side)[None], 0.4)[0]:
                builder.add_tree(point + across * side, "chestnut", 10.0, rng)
    for point in random_points(offset(outline, 0.0), int(area(outline) / 170), 1.5, rng):
        if abs(float((point - middle) @ across)) > 7:
            builder.add_tree(point, ("linden", "fir")[int(rng.integers(2))], 9.0, rng)
