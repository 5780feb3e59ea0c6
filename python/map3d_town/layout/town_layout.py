"""Plans a European town: rings around a market square, main roads, a river, zones from old to new."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from map3d_town.layout.city_blocks import GRUENDER, OLD, CityBlock, fill_industry, fill_perimeter, fill_rows, fill_slabs, fill_villas
from map3d_town.layout.green_spaces import fill_belt, fill_green, fill_park
from map3d_town.layout.landmarks import add_market_square, add_town_hall
from map3d_town.layout.layout_frame import make_layout_frame
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.layout.street_names import street_name
from map3d_town.layout.streets import lay_fields, lay_river, lay_streets
from map3d_town.layout.town_plan import TownPlan
from map3d_town.polygons_2d import Points, area, circle, clip, inset, offset
from map3d_town.seeds import rng

PLAZA_M = 36.0
MAIN_HALF_M = {"old": 4.6, "belt": 7.5, "perimeter": 7.5, "outer": 7.5}
OUTER = {"rows": fill_rows, "villas": fill_villas, "slabs": fill_slabs, "industry": fill_industry}
SHARES = {"perimeter": 0.34, "rows": 0.26, "villas": 0.33, "slabs": 0.035, "industry": 0.035}
DEPTHS = {"old": 46.0, "belt": 33.0, "perimeter": 62.0, "outer": 74.0}
HALF_STREETS = {"old": 2.7, "belt": 5.0, "perimeter": 6.0, "outer": 5.0}


class TownLayout:
    """Adds rings of blocks until the town has all its buildings."""

    def __init__(self, seed: int, wanted: int) -> None:
        self.seed, self.frame = seed, make_layout_frame(seed, wanted)
        self.builder = PlanBuilder(wanted)
        old = 0.5 * wanted if wanted < 120 else 0.58 * wanted if wanted < 400 else min(600.0, 120 + 0.26 * wanted)
        self.remaining = {zone: max(1.0, share * (wanted - old)) for zone, share in SHARES.items()} | {"old": old}
        self.rings: list[tuple[float, float, str]] = []
        self.reach_m = PLAZA_M

    def make_plan(self) -> TownPlan:
        add_market_square(self.builder, self.frame.warp(circle(np.zeros(2), PLAZA_M - 3, 40)), rng(self.seed, "market"))
        ring = 0
        while not self.builder.is_full and ring < 400:
            kind = self._choose_ring_kind(ring)
            inner, self.reach_m = self.reach_m, self.reach_m + DEPTHS[kind]
            self.rings.append((inner, self.reach_m, kind))
            for number, (block, middle) in enumerate(self._ring_blocks(ring, inner, self.reach_m, kind)):
                self._fill_block(block, kind, ring, number, middle)
            ring += 1
        self._add_surroundings()
        return self.builder.finish()

    def _choose_ring_kind(self, ring: int) -> str:
        if self.remaining["old"] > 30 or ring == 0:
            return "old"
        if self.rings[-1][2] == "old" and self.frame.wanted >= 150:
            return "belt"
        return "perimeter" if self.remaining["perimeter"] > 6 and self.frame.wanted >= 100 else "outer"

    def _ring_blocks(self, ring: int, inner: float, outer: float, kind: str) -> Iterator[tuple[CityBlock, Points]]:
        """Yields the blocks of a ring with their centres in layout coordinates: irregular sectors between main roads, without streets and river."""
        half = HALF_STREETS[kind]
        for number, (start, end, main_before, main_after) in enumerate(self._ring_sectors(ring, inner, outer, kind)):
            plain = sector(start, end, inner, outer)
            sides = [half] * len(plain)
            sides[0], sides[-2] = (MAIN_HALF_M[kind] if main_before else half), (MAIN_HALF_M[kind] if main_after else half)
            lot = inset(plain, np.array(sides))
            for part, piece in enumerate(self._clip_to_banks(lot)):
                outline = self.frame.warp(piece)
                if len(outline) >= 3 and area(outline) > 150:
                    source = rng(self.seed, "block", ring, number, part)
                    names = tuple(street_name(self.seed, n) for n in (number, 1000 + ring, number + 1, 1000 + ring - 1))
                    yield CityBlock(outline, names, source), piece.mean(axis=0)

    def _ring_sectors(self, ring: int, inner: float, outer: float, kind: str) -> Iterator[tuple[float, float, bool, bool]]:
        """Yields (start, end, main road at the start, main road at the end); angles in radians."""
        source = rng(self.seed, "ring", ring)
        width = {"old": 52.0, "belt": 62.0, "perimeter": 84.0, "outer": 96.0}[kind]
        roads = [*self.frame.roads, self.frame.roads[0] + 2 * np.pi]
        for a, b in itertools.pairwise(roads):
            count = max(1, round((b - a) * (inner + outer) / 2 / width))
            inside = (np.arange(1, count) + source.uniform(-0.17, 0.17, count - 1)) / count
            cuts = [a, *(a + (b - a) * inside), b]
            for i in range(count):
                yield float(cuts[i]), float(cuts[i + 1]), i == 0, i == count - 1

    def _clip_to_banks(self, polygon: Points) -> list[Points]:
        """Returns the parts of the polygon on both banks of the river."""
        if len(polygon) < 3:
            return []
        y, gap = self.frame.river_y, self.frame.river_half_m + 9.0
        if polygon[:, 1].min() > y + gap or polygon[:, 1].max() < y - gap:
            return [polygon]
        up, level = np.array([0.0, 1.0]), np.array([0.0, y])
        return [p for p in (clip(polygon, level + up * gap, up), clip(polygon, level - up * gap, -up)) if len(p) >= 3]

    def _fill_block(self, block: CityBlock, kind: str, ring: int, number: int, middle: Points) -> None:
        builder, before = self.builder, len(self.builder.plan.buildings)
        builder.add_ground(offset(block.outline, -1.9), "sidewalk", "sidewalk")
        if ring == 0 and number == 0 and add_town_hall(builder, block):
            return
        if kind == "belt":
            fill_belt(builder, block)
            return
        if builder.is_full or area(block.outline) < 450 or (kind != "old" and block.rng.random() < 0.09):
            (fill_park if kind == "old" else fill_green)(builder, block)
            return
        zone = self._choose_zone(block, kind, middle)
        if (zone == "old" and not fill_perimeter(builder, block, OLD)) or (zone == "perimeter" and not fill_perimeter(builder, block, GRUENDER)):
            zone = "villas"
        if zone in OUTER:
            OUTER[zone](builder, block)
        self.remaining[zone] -= len(builder.plan.buildings) - before

    def _choose_zone(self, block: CityBlock, kind: str, middle: Points) -> str:
        """Chooses the zone of a block: the kind of its ring, or outside at random among the zones that still lack buildings."""
        if kind == "old" and (self.remaining[kind] > 3 or self.frame.wanted >= 120):
            return kind
        names = ["perimeter", "rows", "villas", "slabs", "industry"]
        angle = math.atan2(middle[1], middle[0]) - self.frame.roads[1]
        east = math.cos(angle) > 0.75
        size = {"perimeter": 14.0 if kind == "perimeter" else 1e9, "rows": 16.0, "villas": 9.0, "slabs": 3.0, "industry": 2.0}
        weights = np.array([max(self.remaining[z], 0.0) / size[z] for z in names]) + 1e-6
        weights *= np.array([1.6, 1.0, 1.0, 1.0, 8.0 if east else 0.15])
        return names[int(block.rng.choice(len(names), p=weights / weights.sum()))]

    def _add_surroundings(self) -> None:
        """Adds streets, river and fields."""
        lay_streets(self.builder, self.frame, self.rings, self.reach_m, PLAZA_M)
        lay_river(self.builder, self.frame, self.reach_m)
        self.builder.plan.radius_m = float(np.ceil((self.reach_m * 1.12 + 70) / 16) * 16)
        lay_fields(self.builder, self.frame, self.reach_m)


def sector(start: float, end: float, inner: float, outer: float) -> Points:
    """Returns the part of a ring between two angles, with an extra vertex on wide outer arcs; counter-clockwise.

    The inner edge is tangent to the inner circle, so it does not overlap the inner ring.
    """
    near = inner / math.cos(min((end - start) / 2, 1.0))
    angles = [start, end] if end - start < 0.75 else [start, (start + end) / 2, end]
    rim = [(outer, a) for a in angles]
    polar = [(near, start), *rim, (near, end)]
    return np.array([(r * math.cos(a), r * math.sin(a)) for r, a in polar])
