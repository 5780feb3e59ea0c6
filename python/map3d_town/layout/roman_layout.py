"""Plans a Roman town: insulae between cardo and decumanus, forum, theatre, baths, wall with gates and towers."""

import itertools
import math
from dataclasses import replace

import numpy as np

from map3d_town.layout.city_blocks import CityBlock, PerimeterStyle, fill_perimeter, random_points
from map3d_town.layout.massing import part_without_outline, row_part, spire_part
from map3d_town.layout.plan_builder import PlanBuilder
from map3d_town.layout.roman_houses import add_portico, fill_domus
from map3d_town.layout.roman_monuments import add_amphitheatre, add_baths, add_forum, add_macellum, add_theatre
from map3d_town.layout.street_names import VIAE
from map3d_town.layout.town_plan import TownPlan
from map3d_town.polygons_2d import Points, band, circle, offset, rectangle, unit
from map3d_town.seeds import rng

CELL = np.array([52.0, 64.0])
STREET_M, MAIN_M = 6.0, 11.0
PER_CELL, PER_METRE_OF_WALL = 11.0, 1 / 21.0
INSULA = PerimeterStyle(8.0, (2, 4), 3.0, (8.0, 13.0), ("roman",), 0.0, 0.0, "yard", ("roman",), (20, 27))
WALL_STEP_M = 34.0


class RomanLayout:
    """Plans a town on a rotated grid. Columns and rows of cells count from the crossing of the main streets."""

    def __init__(self, seed: int, wanted: int) -> None:
        self.seed, self.builder = seed, PlanBuilder(wanted)
        source = rng(seed, "roman")
        turn = float(source.uniform(0.12, 0.45))
        self.axes = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
        side = 2
        while self._capacity(side) < wanted:
            side += 2
        self.half = max(2, side // 2)
        self.plan_half = self.half * CELL + [STREET_M, STREET_M]
        room = 60 + (110 if self.half >= 3 else 0)
        self.builder.plan.radius_m = float(np.ceil((np.hypot(*self.plan_half) + room) / 16) * 16)

    def _capacity(self, side: int) -> float:
        return max(0, side * side - 7) * PER_CELL + 4 * side * float(CELL.mean()) * PER_METRE_OF_WALL

    def to_town(self, points: Points) -> Points:
        """Converts grid coordinates in metres to town coordinates."""
        return np.asarray(np.asarray(points, dtype=float) @ self.axes)

    def make_plan(self) -> TownPlan:
        self._add_streets()
        source = rng(self.seed, "monuments")
        add_forum(self.builder, self._cells_outline(-1, -1, 2, 1), self.axes[0], source)
        taken = {(-1, -1), (0, -1)}
        if self.half >= 3:
            add_theatre(self.builder, self._cells_outline(-1, -2, 2, 1), -self.axes[1], source)
            add_baths(self.builder, self._cells_outline(-2, 0, 1, 1), self.axes[0], source)
            add_macellum(self.builder, self._cells_outline(1, -1, 1, 1), self.axes[0], source)
            taken |= {(-1, -2), (0, -2), (-2, 0), (1, -1)}
        self._add_wall()
        if self.half >= 3:
            add_amphitheatre(self.builder, self.to_town(self.plan_half * [1.0, -0.35] + [86.0, 0.0]), source)
        self._add_surroundings()
        for x, y in self._sorted_cells():
            if (x, y) not in taken:
                self._fill_cell(x, y)
        self._add_fields()
        return self.builder.finish()

    def _sorted_cells(self) -> list[tuple[int, int]]:
        """Returns the cells from the centre outwards."""
        cells = [(x, y) for x in range(-self.half, self.half) for y in range(-self.half, self.half)]
        return sorted(cells, key=lambda c: (max(abs(c[0] + 0.5), abs(c[1] + 0.5)), c))

    def _cells_outline(self, x: int, y: int, across: int, up: int) -> Points:
        """Returns the outline of adjacent cells, without the streets around them."""
        low, high = np.array([x, y]) * CELL, np.array([x + across, y + up]) * CELL
        gap_low = [MAIN_M / 2 if v == 0 else STREET_M / 2 for v in (x, y)]
        gap_high = [MAIN_M / 2 if v == 0 else STREET_M / 2 for v in (x + across, y + up)]
        (x0, y0), (x1, y1) = low + gap_low, high - gap_high
        return self.to_town(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))

    def _fill_cell(self, x: int, y: int) -> None:
        """Fills a cell with apartments around a court, town houses, or a garden, always a garden when the town is full."""
        source = rng(self.seed, "insula", x, y)
        outline = self._cells_outline(x, y, 1, 1)
        names = tuple(VIAE[(x * 3 + y + k) % len(VIAE)] for k in range(4))
        builder = self.builder
        builder.add_ground(offset(outline, -1.3), "sidewalk", "sidewalk")
        main = [k for k, edge in enumerate((y == 0, x == -1, y == -1, x == 0)) if edge]
        for k in main:
            add_portico(builder, outline[k], outline[(k + 1) % 4], 3.4, source)
        inner = np.array(outline)
        for k in main:
            a, b = outline[k], outline[(k + 1) % 4]
            push = np.array([-(b - a)[1], (b - a)[0]]) / np.hypot(*(b - a)) * 3.4
            inner[k], inner[(k + 1) % 4] = inner[k] + push, inner[(k + 1) % 4] + push
        block = CityBlock(inner, names, source)
        choice = source.random()
        if builder.is_full or choice < 0.06:
            _lay_garden(builder, block)
        elif choice < 0.5:
            fill_perimeter(builder, block, INSULA)
        else:
            fill_domus(builder, block)

    def _add_streets(self) -> None:
        """Adds the paved streets; main streets continue to the edge of the map."""
        w, h = self.plan_half
        self.builder.add_ground(self.to_town(np.array([[-w, -h], [w, -h], [w, h], [-w, h]])), "cobble", "town")
        for line in ([[-w - 900, 0], [w + 900, 0]], [[0, -h - 900], [0, h + 900]]):
            for quad in band(self.to_town(np.array(line, dtype=float)), MAIN_M - 2):
                self.builder.add_ground(quad, "plaza", "bridge")

    def _add_wall(self) -> None:
        """Adds the town wall with round towers, and a gate at the end of each main street."""
        w, h = self.plan_half + 9.0
        corners = np.array([[-w, -h], [w, -h], [w, h], [-w, h]])
        self.builder.add_ground(self.to_town(corners * (1 + 4 / w)), "meadow", "road_out")
        for k in range(4):
            a, b = corners[k], corners[(k + 1) % 4]
            length = float(np.hypot(*(b - a)))
            along = (b - a) / length
            half = int((length / 2 - 9) // WALL_STEP_M) + 1
            reach = np.linspace(9.0, length / 2, half + 1)
            stops = [*(length / 2 - reach[::-1]), *(length / 2 + reach)]
            for s, t in itertools.pairwise(stops):
                if t - s > 18.01 or abs(s + t - length) > 1:
                    self._add_wall_piece(a + along * s, a + along * t)
            for s in stops[:-1]:
                if abs(s - length / 2) > 9.5:
                    self._add_tower(a + along * s)
            self._add_gate(a + along * length / 2, along)

    def _add_wall_piece(self, a: Points, b: Points) -> None:
        a, b = self.to_town(a), self.to_town(b)
        along = unit(b - a)
        part = part_without_outline(6.8, 1, "wall", "paving", roof_type="1000")
        profile = ((0.0, 0.5), (0.22, 0.5), (0.22, 0.0), (1.0, 0.0))
        made = row_part(a, b, 2.6, profile, part, ("blank", "blank", "party", "party"))
        inward = np.array([-along[1], along[0]])
        spots = [a + along * s + inward * 0.3 for s in np.arange(1.2, np.hypot(*(b - a)) - 1, 2.2)]
        merlons = tuple(("merlon", (float(p[0]), float(p[1]), 0.42, 7.2, 8.3)) for p in spots)
        self.builder.add_building("wall", "", [made], installations=merlons)

    def _add_tower(self, at: Points) -> None:
        outline = circle(self.to_town(at), 4.4, 12)
        part = replace(part_without_outline(11.0, 3, "wall", "roman", 0.4), sides=("street",) * 12)
        self.builder.add_building("tower", "", [spire_part(outline, ((0.0, 0.0), (1.0, 3.4)), part)])

    def _add_gate(self, at: Points, along: Points) -> None:
        """Adds two round towers and a house over the open passage between them."""
        ahead = self.to_town(along)
        middle = self.to_town(at)
        inward = np.array([-ahead[1], ahead[0]])
        parts = []
        for sign in (-1, 1):
            outline = circle(middle + ahead * (6.4 * sign) + inward, 3.9, 12)
            part = replace(part_without_outline(13.0, 4, "wall", "roman", 0.4), sides=("street",) * 12)
            parts.append(spire_part(outline, ((0.0, 0.0), (1.0, 3.0)), part))
        house = rectangle(middle + inward * 1.5, ahead, 9.5, 5.0)
        over = replace(part_without_outline(10.2, 3, "wall", "roman", 0.4), lift_m=5.0)
        parts.append(row_part(house[0], house[1], 5.0, ((0.0, 0.0), (0.5, 1.4), (1.0, 0.0)), over, ("street", "street", "blank", "blank")))
        self.builder.add_building("gate", "", parts)

    def _add_surroundings(self) -> None:
        """Adds cypresses and tombs along the roads out of town, and an aqueduct from the north."""
        source = rng(self.seed, "outside")
        for k, reach in enumerate((self.plan_half[0], self.plan_half[0], self.plan_half[1], self.plan_half[1])):
            along = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)][k], dtype=float)
            aside = np.array([-along[1], along[0]])
            for s in np.arange(reach + 24, reach + 150, 9.0):
                for side in (-1, 1):
                    self.builder.add_tree(self.to_town(along * s + aside * 7.5 * side), "cypress", 9.0, source)
            for s in np.arange(reach + 34, reach + 110, 27.0):
                spot = self.to_town(along * s + aside * (13.0 * (1 if source.random() < 0.5 else -1)))
                outline = rectangle(spot, self.to_town(along), 4.2, 3.6)
                part = replace(part_without_outline(3.2, 1, "temple", "roman", 0.2), sides=("blank",) * 4)
                if self._is_on_map(spot):
                    self.builder.add_building("tomb", "", [spire_part(outline, ((0.0, 0.0), (1.0, 1.1)), part)])
        for s in np.arange(self.plan_half[1] + 14, self.plan_half[1] + 150, 30.0):
            if self._is_on_map(self.to_town(np.array([-2.5 * CELL[0], s + 30.0]))):
                self._add_aqueduct_piece(np.array([-2.5 * CELL[0], s]), np.array([-2.5 * CELL[0], s + 30.0]))

    def _is_on_map(self, at: Points) -> bool:
        return bool(np.abs(at).max() < self.builder.plan.radius_m - 12)

    def _add_aqueduct_piece(self, a: Points, b: Points) -> None:
        a, b = self.to_town(a), self.to_town(b)
        part = replace(part_without_outline(11.0, 1, "wall", "paving", roof_type="1000"), lift_m=8.8)
        made = row_part(a, b, 2.0, ((0.0, 0.0), (0.25, 0.0), (0.25, -0.7), (0.75, -0.7), (0.75, 0.0), (1.0, 0.0)), part, ("blank",) * 4)
        inward = np.array([-(b - a)[1], (b - a)[0]]) / np.hypot(*(b - a))
        spots = [a + (b - a) * t + inward for t in (1 / 12, 3 / 12, 5 / 12, 7 / 12, 9 / 12, 11 / 12)]
        piers = tuple(("merlon", (float(p[0]), float(p[1]), 1.25, -0.6, 8.8)) for p in spots)
        self.builder.add_building("aqueduct", "", [made], installations=piers)

    def _add_fields(self) -> None:
        """Adds fields, meadows and olive groves around the town."""
        source, radius, size = rng(self.seed, "fields"), self.builder.plan.radius_m, 90.0
        count = int(np.ceil(radius * 1.5 / size))
        clear = self.plan_half + 26
        for x in range(-count, count):
            for y in range(-count, count):
                corner = np.array([x, y]) * size
                quad = corner + size * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
                material = ("field_gold", "meadow", "field_green", "field_brown", "meadow")[int(source.integers(5))]
                self.builder.add_ground(self.to_town(quad), material, "field")
                if source.random() < 0.4 and (np.abs(corner + size / 2) > clear + size / 2).any():
                    self._add_olive_grove(corner, size, source)

    def _add_olive_grove(self, corner: Points, size: float, source: np.random.Generator) -> None:
        """Adds rows of olive trees, clear of roads, amphitheatre and the edge of the map."""
        arena = self.plan_half * [1.0, -0.35] + [86.0, 0.0]
        for u in np.arange(8, size - 4, 11.0):
            for v in np.arange(8, size - 4, 11.0):
                spot = corner + np.array([u, v])
                at = self.to_town(spot)
                clear = min(abs(spot[0]), abs(spot[1])) > 18 and np.hypot(*(spot - arena)) > 62
                if clear and np.abs(at).max() < self.builder.plan.radius_m - 4 and abs(spot[0] + 2.5 * CELL[0]) > 6:
                    self.builder.add_tree(at, "olive", 4.6, source)


def _lay_garden(builder: PlanBuilder, block: CityBlock) -> None:
    """Adds a garden with paths, a basin, pines, cypresses and olive trees."""
    outline, source = block.outline, block.rng
    builder.add_ground(outline, "lawn", "block")
    middle = outline.mean(axis=0)
    for k in range(2):
        a, b = (outline[k] + outline[k + 1]) / 2, (outline[(k + 2) % 4] + outline[(k + 3) % 4]) / 2
        builder.add_ground(rectangle(middle, unit(b - a), float(np.hypot(*(b - a))), 2.6), "gravel", "path")
    builder.add_ground(circle(middle, 5.0, 24), "gravel", "thing")
    builder.add_ground(circle(middle, 3.4, 24), "water", "thing")
    for point in random_points(outline, 34, 2.0, source):
        if np.hypot(*(point - middle)) > 7:
            builder.add_tree(point, ("pine", "cypress", "olive")[int(source.integers(3))], 8.5, source)
