"""The plan of a European town: rings around a market square, main roads to its gates, a river, zones from old to new."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from map3d_town.blocks import GRUENDER, OLD, Block, fill_industry, fill_perimeter, fill_rows, fill_slabs, fill_villas
from map3d_town.greens import fill_belt, fill_green, fill_park
from map3d_town.landmarks import market_square, town_hall
from map3d_town.model import Plan
from map3d_town.names import street_name
from map3d_town.plane import area, circle, clip, inset, offset
from map3d_town.seeds import rng
from map3d_town.sketch import Sketch
from map3d_town.streets import lay_fields, lay_river, lay_streets

Points = NDArray[np.float64]
PLAZA_M = 36.0
MAIN_HALF_M = {"old": 4.6, "belt": 7.5, "perimeter": 7.5, "outer": 7.5}
OUTER = {"rows": fill_rows, "villas": fill_villas, "slabs": fill_slabs, "industry": fill_industry}
SHARES = {"perimeter": 0.34, "rows": 0.26, "villas": 0.33, "slabs": 0.035, "industry": 0.035}
DEPTHS = {"old": 46.0, "belt": 33.0, "perimeter": 62.0, "outer": 74.0}
HALF_STREETS = {"old": 2.7, "belt": 5.0, "perimeter": 6.0, "outer": 5.0}


@dataclass
class Frame:
    """How the plain rings are bent into a grown town, and where roads and river run (before bending)."""

    seed: int
    wanted: int
    roads: tuple[float, ...] = ()
    river_y: float = 0.0
    river_half_m: float = 0.0
    waves: list[tuple[float, float, float, float, float]] = field(default_factory=list)

    def bend(self, points: Points) -> Points:
        """Plain coordinates to town coordinates; smooth, never folding."""
        p = np.asarray(points, dtype=float).reshape(-1, 2)
        out = p * np.array([1.07, 0.95])
        for kx, ky, phase, sx, sy in self.waves:
            wave = np.sin(p[:, 0] * kx + p[:, 1] * ky + phase)
            out = out + wave[:, None] * np.array([sx, sy])
        return np.asarray(out)


def make_frame(seed: int, wanted: int) -> Frame:
    source = rng(seed, "frame")
    count = 4 if wanted < 120 else 5 if wanted < 2000 else 7
    turn = source.uniform(0, 2 * np.pi)
    roads = tuple(float(turn + (i + source.uniform(-0.16, 0.16)) * 2 * np.pi / count) for i in range(count))
    reach = math.sqrt(max(wanted, 10) * 640 / math.pi)
    frame = Frame(seed, wanted, roads, -max(0.55 * reach, 92.0), 9.0 if wanted < 120 else 14.0)
    for length, size in ((620.0, 12.0), (310.0, 6.0), (170.0, 2.6)):
        for _ in range(2):
            angle, phase = source.uniform(0, 2 * np.pi, 2)
            k = 2 * np.pi / length
            sx, sy = source.normal(0, size * 0.7, 2)
            frame.waves.append((float(k * np.cos(angle)), float(k * np.sin(angle)), float(phase), float(sx), float(sy)))
    return frame


class TownPlan:
    """Draws a town ring by ring until all buildings have found their place."""

    def __init__(self, seed: int, wanted: int) -> None:
        self.seed, self.frame = seed, make_frame(seed, wanted)
        self.sketch = Sketch(wanted)
        old = 0.5 * wanted if wanted < 120 else 0.58 * wanted if wanted < 400 else min(600.0, 120 + 0.26 * wanted)
        self.left = {zone: max(1.0, share * (wanted - old)) for zone, share in SHARES.items()} | {"old": old}
        self.rings: list[tuple[float, float, str]] = []
        self.reach_m = PLAZA_M

    def draw(self) -> Plan:
        market_square(self.sketch, self.frame.bend(circle(np.zeros(2), PLAZA_M - 3, 40)), rng(self.seed, "market"))
        ring = 0
        while not self.sketch.full and ring < 400:
            kind = self.ring_kind(ring)
            inner, self.reach_m = self.reach_m, self.reach_m + DEPTHS[kind]
            self.rings.append((inner, self.reach_m, kind))
            for number, (block, middle) in enumerate(self.blocks(ring, inner, self.reach_m, kind)):
                self.fill(block, kind, ring, number, middle)
            ring += 1
        self.surroundings()
        return self.sketch.finished()

    def ring_kind(self, ring: int) -> str:
        if self.left["old"] > 30 or ring == 0:
            return "old"
        if self.rings[-1][2] == "old" and self.frame.wanted >= 150:
            return "belt"
        return "perimeter" if self.left["perimeter"] > 6 and self.frame.wanted >= 100 else "outer"

    def blocks(self, ring: int, inner: float, outer: float, kind: str) -> Iterator[tuple[Block, Points]]:
        """The blocks of a ring: sectors between main roads, cut irregularly, without streets and river."""
        half = HALF_STREETS[kind]
        for number, (start, end, main_before, main_after) in enumerate(self.sectors(ring, inner, outer, kind)):
            plain = sector(start, end, inner, outer)
            sides = [half] * len(plain)
            sides[0], sides[-2] = (MAIN_HALF_M[kind] if main_before else half), (MAIN_HALF_M[kind] if main_after else half)
            lot = inset(plain, np.array(sides))
            for part, piece in enumerate(self.beside_river(lot)):
                outline = self.frame.bend(piece)
                if len(outline) >= 3 and area(outline) > 150:
                    source = rng(self.seed, "block", ring, number, part)
                    names = tuple(street_name(self.seed, n) for n in (number, 1000 + ring, number + 1, 1000 + ring - 1))
                    yield Block(outline, names, source), piece.mean(axis=0)

    def sectors(self, ring: int, inner: float, outer: float, kind: str) -> Iterator[tuple[float, float, bool, bool]]:
        """(start, end, main road at the start, main road at the end), angles in radians."""
        source = rng(self.seed, "ring", ring)
        width = {"old": 52.0, "belt": 62.0, "perimeter": 84.0, "outer": 96.0}[kind]
        roads = [*self.frame.roads, self.frame.roads[0] + 2 * np.pi]
        for a, b in itertools.pairwise(roads):
            count = max(1, round((b - a) * (inner + outer) / 2 / width))
            inside = (np.arange(1, count) + source.uniform(-0.17, 0.17, count - 1)) / count
            cuts = [a, *(a + (b - a) * inside), b]
            for i in range(count):
                yield float(cuts[i]), float(cuts[i + 1]), i == 0, i == count - 1

    def beside_river(self, polygon: Points) -> list[Points]:
        if len(polygon) < 3:
            return []
        y, gap = self.frame.river_y, self.frame.river_half_m + 9.0
        if polygon[:, 1].min() > y + gap or polygon[:, 1].max() < y - gap:
            return [polygon]
        up, level = np.array([0.0, 1.0]), np.array([0.0, y])
        return [p for p in (clip(polygon, level + up * gap, up), clip(polygon, level - up * gap, -up)) if len(p) >= 3]

    def fill(self, block: Block, kind: str, ring: int, number: int, middle: Points) -> None:
        sketch, before = self.sketch, len(self.sketch.plan.lots)
        sketch.patch(offset(block.outline, -1.9), "sidewalk", "sidewalk")
        if ring == 0 and number == 0 and town_hall(sketch, block):
            return
        if kind == "belt":
            fill_belt(sketch, block)
            return
        if sketch.full or area(block.outline) < 450 or (kind != "old" and block.rng.random() < 0.09):
            (fill_park if kind == "old" else fill_green)(sketch, block)
            return
        zone = self.zone(block, kind, middle)
        if (zone == "old" and not fill_perimeter(sketch, block, OLD)) or (zone == "perimeter" and not fill_perimeter(sketch, block, GRUENDER)):
            zone = "villas"
        if zone in OUTER:
            OUTER[zone](sketch, block)
        self.left[zone] -= len(sketch.plan.lots) - before

    def zone(self, block: Block, kind: str, middle: Points) -> str:
        """What is built here: the ring's kind, or outside a mixture of what is still wanted."""
        if kind == "old" and (self.left[kind] > 3 or self.frame.wanted >= 120):
            return kind
        names = ["perimeter", "rows", "villas", "slabs", "industry"]
        angle = math.atan2(middle[1], middle[0]) - self.frame.roads[1]
        east = math.cos(angle) > 0.75
        size = {"perimeter": 14.0 if kind == "perimeter" else 1e9, "rows": 16.0, "villas": 9.0, "slabs": 3.0, "industry": 2.0}
        weights = np.array([max(self.left[z], 0.0) / size[z] for z in names]) + 1e-6
        weights *= np.array([1.6, 1.0, 1.0, 1.0, 8.0 if east else 0.15])
        return names[int(block.rng.choice(len(names), p=weights / weights.sum()))]

    def surroundings(self) -> None:
        """Asphalt under the town, roads, river, fields around, alley trees."""
        lay_streets(self.sketch, self.frame, self.rings, self.reach_m, PLAZA_M)
        lay_river(self.sketch, self.frame, self.reach_m)
        self.sketch.plan.radius_m = float(np.ceil((self.reach_m * 1.12 + 70) / 16) * 16)
        lay_fields(self.sketch, self.frame, self.reach_m)


def sector(start: float, end: float, inner: float, outer: float) -> Points:
    """The part of a ring between two angles: corners, and middle points of wide outer arcs; counter-clockwise.

    The inner edge is a chord that touches the inner circle, so that it never reaches into the ring inside.
    """
    near = inner / math.cos(min((end - start) / 2, 1.0))
    angles = [start, end] if end - start < 0.75 else [start, (start + end) / 2, end]
    rim = [(outer, a) for a in angles]
    polar = [(near, start), *rim, (near, end)]
    return np.array([(r * math.cos(a), r * math.sin(a)) for r, a in polar])
