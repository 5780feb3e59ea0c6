"""The plan of a town: buildings, ground and trees in town coordinates (metres; origin at the town's centre, x east, y north)."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from map3d_town.polygons_2d import Points

PlannedInstallations = tuple[tuple[str, tuple[float, ...]], ...]


@dataclass(frozen=True, slots=True)
class BuildingPart:
    """A body whose side lines run from front[k] to back[k], with one roof profile along all of them.

    The body is to the left of `front`. An open chain has end walls; a closed one is a ring around a courtyard (`hollow`), or is covered
    at the last height of its profile. `profile` holds (t, height above the eave), with t = 0 at the front and 1 at the back. `sides` holds
    "street", "yard", "party" or "blank" for each front edge, each back edge and the two ends. `lift_m`: height of the underside above the
    ground; None for a part that stands on it.
    """

    front: Points
    back: Points
    profile: tuple[tuple[float, float], ...]
    eave_m: float
    closed: bool = False
    hollow: bool = False
    sides: tuple[str, ...] = ()
    storeys: int = 1
    overhang_m: float = 0.0
    roof_type: str = "1000"
    facade_kind: str = "house"
    cover: str = "tiles"
    half_hip_m: float = 0.0
    lift_m: float | None = None

    @property
    def footprint(self) -> Points:
        """Outer ring, (n, 2), counter-clockwise."""
        return self.front if self.closed else np.concatenate([self.front, self.back[::-1]])


@dataclass(frozen=True, slots=True)
class BuildingPlan:
    """The parts and address of one building.

    `installations`: columns as ("column", (x, y, radius, low, high)) and blocks as ("merlon", (x, y, half diagonal, low, high)); heights
    are above the ground.
    """

    number: int
    kind: str
    function: str
    parts: tuple[BuildingPart, ...]
    street: str = ""
    house_number: int = 0
    installations: PlannedInstallations = ()


@dataclass(frozen=True, slots=True)
class GroundPatch:
    """A polygon of one ground material in the orthophoto. Patches with a higher `order` cover lower ones."""

    polygon: Points
    material: str
    order: int


@dataclass(frozen=True, slots=True)
class PlannedTree:
    """A tree at (x, y); `turn` is its rotation in radians."""

    x: float
    y: float
    species: str
    height_m: float
    turn: float


@dataclass
class TownPlan:
    """All buildings, ground patches and trees of a town. `radius_m`: half the side of its square."""

    buildings: list[BuildingPlan] = field(default_factory=list)
    patches: list[GroundPatch] = field(default_factory=list)
    trees: list[PlannedTree] = field(default_factory=list)
    radius_m: float = 0.0

    def __getstate__(self) -> dict[str, Any]:
        """Pickles the patches, of which there may be hundreds of thousands, as four arrays."""
        corners = np.concatenate([patch.polygon for patch in self.patches]) if self.patches else np.zeros((0, 2))
        ends = np.cumsum([len(patch.polygon) for patch in self.patches], dtype=np.int64)
        rest = [patch.material for patch in self.patches], [patch.order for patch in self.patches]
        return {**self.__dict__, "patches": (corners, ends, *rest)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        corners, ends, materials, orders = state["patches"]
        polygons = np.split(corners, ends[:-1]) if len(ends) else []
        self.__dict__ |= {**state, "patches": list(map(GroundPatch, polygons, materials, orders))}
