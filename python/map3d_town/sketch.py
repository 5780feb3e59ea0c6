"""A town while it is drawn: numbers its lots, lays its patches, plants its trees."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from map3d_town.house import footprint
from map3d_town.model import Lot, Part, Patch, Plan, Tree

Points = NDArray[np.float64]
ORDER = {
    "field": 0, "forest": 1, "road_out": 3, "town": 4, "bank": 6, "water": 7, "bridge": 8, "sidewalk": 10, "block": 12,
    "parcel": 14, "path": 16, "thing": 17, "mark": 20, "roof": 25,
}  # fmt: skip
ROOF_MATERIALS = {"tiles": "roof_red", "dark": "roof_dark", "slate": "roof_dark", "flat": "roof_flat", "metal": "roof_metal", "roman": "roof_red"}


class Sketch:
    """Collects a plan; at most `wanted` buildings are taken, more are left out."""

    def __init__(self, wanted: int) -> None:
        self.plan = Plan()
        self.wanted = wanted

    @property
    def full(self) -> bool:
        return len(self.plan.lots) >= self.wanted

    def lot(
        self,
        kind: str,
        function: str,
        parts: Iterable[Part],
        street: str = "",
        number: int = 0,
        extras: tuple[tuple[str, tuple[float, ...]], ...] = (),
    ) -> bool:
        """Adds a building with its roofs in the orthophoto; False when the town is full."""
        if self.full:
            return False
        made = Lot(len(self.plan.lots), kind, function, tuple(parts), street, number, extras)
        self.plan.lots.append(made)
        for part in made.parts:
            self.roof_patch(part)
        return True

    def roof_patch(self, part: Part) -> None:
        """The roof of a part as seen from above."""
        material = ROOF_MATERIALS.get(part.cover, "roof_flat")
        if part.closed and part.hollow:
            n = len(part.front)
            for k in range(n):
                j = (k + 1) % n
                quad = np.array([part.front[k], part.front[j], part.back[j], part.back[k]])
                self.patch(quad, material, "roof")
        else:
            self.patch(footprint(part), material, "roof")

    def patch(self, polygon: Points, material: str, order: str) -> None:
        """Lays a piece of ground."""
        if len(polygon) >= 3:
            self.plan.patches.append(Patch(np.asarray(polygon, dtype=float), material, ORDER[order]))

    def finished(self) -> Plan:
        """The plan without trees at or beyond the edge of the map."""
        reach = self.plan.radius_m - 6
        self.plan.trees = [t for t in self.plan.trees if max(abs(t.x), abs(t.y)) < reach]
        return self.plan

    def tree(self, at: Points, species: str, height_m: float, rng: np.random.Generator) -> None:
        """Plants a tree, turned and sized by chance."""
        height = height_m * float(rng.uniform(0.8, 1.2))
        self.plan.trees.append(Tree(float(at[0]), float(at[1]), species, height, float(rng.uniform(0, 2 * np.pi))))
