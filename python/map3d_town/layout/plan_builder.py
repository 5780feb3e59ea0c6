"""Builds a town plan: numbers the buildings, adds ground patches and trees."""

from collections.abc import Iterable

import numpy as np

from map3d_town.layout.town_plan import BuildingPart, BuildingPlan, GroundPatch, PlannedInstallations, PlannedTree, TownPlan
from map3d_town.polygons_2d import Points

ORDER = {
    "field": 0, "forest": 1, "road_out": 3, "town": 4, "bank": 6, "water": 7, "bridge": 8, "sidewalk": 10, "block": 12,
    "parcel": 14, "path": 16, "thing": 17, "mark": 20, "roof": 25,
}  # fmt: skip
ROOF_MATERIALS = {"tiles": "roof_red", "dark": "roof_dark", "slate": "roof_dark", "flat": "roof_flat", "metal": "roof_metal", "roman": "roof_red"}


class PlanBuilder:
    """Collects the plan of a town of at most `wanted` buildings."""

    def __init__(self, wanted: int) -> None:
        self.plan = TownPlan()
        self.wanted = wanted
        self._addresses: set[tuple[str, int]] = set()

    @property
    def is_full(self) -> bool:
        return len(self.plan.buildings) >= self.wanted

    def add_building(
        self, kind: str, function: str, parts: Iterable[BuildingPart], street: str = "", number: int = 0, installations: PlannedInstallations = ()
    ) -> bool:
        """Adds a building and its roofs in the orthophoto. An address that is taken becomes the next free one on the same side of the street.
        Returns False when the town is full."""
        if self.is_full:
            return False
        while street and (street, number) in self._addresses:
            number += 2
        self._addresses.add((street, number))
        building = BuildingPlan(len(self.plan.buildings), kind, function, tuple(parts), street, number, installations)
        self.plan.buildings.append(building)
        for part in building.parts:
            self._add_roof(part)
        return True

    def _add_roof(self, part: BuildingPart) -> None:
        material = ROOF_MATERIALS.get(part.cover, "roof_flat")
        if not (part.closed and part.hollow):
            self.add_ground(part.footprint, material, "roof")
            return
        n = len(part.front)
        for k in range(n):
            j = (k + 1) % n
            self.add_ground(np.array([part.front[k], part.front[j], part.back[j], part.back[k]]), material, "roof")

    def add_ground(self, polygon: Points, material: str, order: str) -> None:
        """Adds a ground patch; `order` is a key of ORDER."""
        if len(polygon) >= 3:
            self.plan.patches.append(GroundPatch(np.asarray(polygon, dtype=float), material, ORDER[order]))

    def add_tree(self, at: Points, species: str, height_m: float, rng: np.random.Generator) -> None:
        """Adds a tree of random rotation and of `height_m` ± 20 %."""
        height = height_m * float(rng.uniform(0.8, 1.2))
        self.plan.trees.append(PlannedTree(float(at[0]), float(at[1]), species, height, float(rng.uniform(0, 2 * np.pi))))

    def finish(self) -> TownPlan:
        """Returns the plan without trees near or outside the edge of the map."""
        reach = self.plan.radius_m - 6
        self.plan.trees = [t for t in self.plan.trees if max(abs(t.x), abs(t.y)) < reach]
        return self.plan
