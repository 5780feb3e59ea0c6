"""Blocks without houses: parks, orchards, sports grounds, allotments, meadows, car parks."""

import itertools

import numpy as np
from numpy.typing import NDArray

from map3d_town.blocks import Block, scattered, shed
from map3d_town.plane import area, contains, inset, left, offset, rectangle, unit
from map3d_town.sketch import Sketch

Points = NDArray[np.float64]


def fill_park(sketch: Sketch, block: Block) -> None:
    """Lawn with a path around it, a winding one across, a pond when it is large, and many trees."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "lawn", "block")
    middle, size = outline.mean(axis=0), float(np.sqrt(area(outline)))
    walk = inset(outline, 4.0)
    if len(walk) >= 3 and area(walk) > 250:
        sketch.patch(walk, "gravel", "path")
        sketch.patch(inset(walk, 2.2), "lawn_light", "path")
    pond = area(outline) > 2200
    crossing(sketch, outline, rng)
    if pond:
        angle = np.linspace(0, 2 * np.pi, 28, endpoint=False)
        reach = size * 0.14 * (1 + 0.16 * np.sin(3 * angle + rng.uniform(0, 6)) + 0.1 * np.sin(2 * angle))
        shore = np.stack([np.cos(angle) * 1.3, np.sin(angle)], axis=1)
        sketch.patch(middle + (reach + 1.2)[:, None] * shore, "gravel", "thing")
        sketch.patch(middle + reach[:, None] * shore, "water", "thing")
    for point in scattered(outline, int(area(outline) / 85), 1.5, rng):
        if not pond or np.hypot(*(point - middle)) > size * 0.23:
            sketch.tree(point, ("linden", "chestnut", "fir", "linden")[int(rng.integers(4))], float(rng.uniform(8, 13)), rng)


def crossing(sketch: Sketch, outline: Points, rng: np.random.Generator) -> None:
    """A winding path between the middles of two opposite edges."""
    n = len(outline)
    first = int(rng.integers(n))
    a = (outline[first] + outline[(first + 1) % n]) / 2
    other = (first + n // 2) % n
    b = (outline[other] + outline[(other + 1) % n]) / 2
    t = np.linspace(0, 1, 15)
    sway = np.sin(t * 2 * np.pi) * np.hypot(*(b - a)) * 0.07
    line = a + (b - a) * t[:, None] + left(unit(b - a)) * sway[:, None]
    for start, end in itertools.pairwise(line):
        length = float(np.hypot(*(end - start)))
        sketch.patch(rectangle((start + end) / 2, unit(end - start), length + 1.2, 2.2), "gravel", "path")


def fill_orchard(sketch: Sketch, block: Block) -> None:
    """Fruit trees in rows on a meadow."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "meadow", "block")
    for point in lattice(outline, 8.0, 3.0):
        if rng.random() < 0.85:
            sketch.tree(point + rng.normal(0, 0.4, 2), "apple", 4.8, rng)


def lattice(outline: Points, step_m: float, margin_m: float) -> Points:
    """Points in rows along the first edge, inside the outline."""
    along = unit(outline[1] - outline[0])
    axes = np.array([along, left(along)])
    reach = outline @ axes.T
    low, high = reach.min(axis=0), reach.max(axis=0)
    u, v = np.meshgrid(np.arange(low[0], high[0], step_m), np.arange(low[1], high[1], step_m))
    points = np.stack([u.ravel(), v.ravel()], axis=1) @ axes
    return np.asarray(points[contains(outline, points, margin_m)])


def fill_sports(sketch: Sketch, block: Block) -> bool:
    """A football pitch with its lines, trees around; False when there is no room."""
    rng, outline = block.rng, block.outline
    first = unit(outline[2] - outline[1])
    for along in (first, left(first), unit(outline[1] - outline[0])):
        for length in (62.0, 52.0, 44.0):
            pitch = rectangle(outline.mean(axis=0), along, length, length * 0.62)
            if contains(outline, pitch, 2.5).all():
                sketch.patch(outline, "lawn", "block")
                pitch_lines(sketch, pitch)
                for point in scattered(outline, int(area(outline) / 130), 1.0, rng):
                    if not contains(pitch, point[None], -3.0)[0]:
                        sketch.tree(point, "linden", 8.0, rng)
                return True
    return False


def pitch_lines(sketch: Sketch, pitch: Points) -> None:
    """The pitch: outer lines, middle line, circle, penalty areas."""
    a, b, _, d = pitch
    along, across, middle = unit(b - a), unit(d - a), pitch.mean(axis=0)
    length, width = float(np.hypot(*(b - a))), float(np.hypot(*(d - a)))

    def frame(centre: Points, u: float, v: float, material: str = "lawn_light") -> None:
        sketch.patch(rectangle(centre, along, u, v), "mark", "path")
        sketch.patch(rectangle(centre, along, u - 0.3, v - 0.3), material, "path")

    frame(middle, length, width)
    for sign in (-1, 1):
        frame(middle + along * sign * (length / 2 - 5.5), 11.0, width * 0.55)
    ring = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    for radius, material in ((6.2, "mark"), (5.9, "lawn_light")):
        sketch.patch(middle + radius * (np.cos(ring)[:, None] * along + np.sin(ring)[:, None] * across), material, "path")
    sketch.patch(rectangle(middle, along, 0.25, width), "mark", "path")


def fill_allotments(sketch: Sketch, block: Block) -> None:
    """Small gardens with huts in the middle of beds and fruit trees."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "lawn", "block")
    along = unit(outline[1] - outline[0])
    for number, point in enumerate(lattice(outline, 12.0, 6.5)):
        plot = rectangle(point, along, 11.0, 11.0)
        sketch.patch(plot, ("garden", "lawn", "lawn_light", "field_green")[int(rng.integers(4))], "parcel")
        sketch.patch(rectangle(point + along * 2.6, along, 3.6, 8.0), "field_brown", "parcel")
        if not sketch.full and number % 2 == 0:
            shed(sketch, rectangle(point - along * 2.6, along, 3.6, 2.8), rng)
        if rng.random() < 0.7:
            sketch.tree(point + left(along) * 4.5, "apple", 4.0, rng)


def fill_meadow(sketch: Sketch, block: Block) -> None:
    """Grass with a few trees."""
    sketch.patch(block.outline, "meadow", "block")
    for point in scattered(block.outline, int(area(block.outline) / 420), 2.0, block.rng):
        sketch.tree(point, ("linden", "apple", "chestnut")[int(block.rng.integers(3))], 8.0, block.rng)


def fill_green(sketch: Sketch, block: Block) -> None:
    """Something without houses, by chance."""
    choice = block.rng.random()
    if area(block.outline) < 700 or choice < 0.3:
        fill_park(sketch, block)
    elif choice < 0.5 and fill_sports(sketch, block):
        return
    elif choice < 0.72:
        fill_orchard(sketch, block)
    elif choice < 0.86:
        fill_allotments(sketch, block)
    else:
        fill_meadow(sketch, block)


def fill_belt(sketch: Sketch, block: Block) -> None:
    """A piece of the green belt where the town wall stood: lawn, a walk along its middle, rows of trees."""
    rng, outline = block.rng, block.outline
    sketch.patch(outline, "lawn", "block")
    edges = np.roll(outline, -1, axis=0) - outline
    along = unit(edges[int(np.argmax(np.hypot(edges[:, 0], edges[:, 1])))])
    middle, across = outline.mean(axis=0), left(along)
    spots = middle + np.arange(-90.0, 90.0, 2.0)[:, None] * along
    inside = spots[contains(outline, spots, 1.5)]
    for point in inside:
        sketch.patch(rectangle(point, along, 2.3, 3.0), "gravel", "path")
    for point in inside[::4]:
        for side in (-3.7, 3.7):
            if contains(outline, (point + across * side)[None], 0.4)[0]:
                sketch.tree(point + across * side, "chestnut", 10.0, rng)
    for point in scattered(offset(outline, 0.0), int(area(outline) / 170), 1.5, rng):
        if abs(float((point - middle) @ across)) > 7:
            sketch.tree(point, ("linden", "fir")[int(rng.integers(2))], 9.0, rng)
