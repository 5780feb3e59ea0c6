"""What a town is made of. Plans are plain data in town coordinates: metres, (0, 0) the town's middle, x east, y north."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]

WALL, ROOF, GROUND = "WallSurface", "RoofSurface", "GroundSurface"


@dataclass(frozen=True)
class Part:
    """A body: side lines run from front[k] to back[k], and the roof's profile runs along them.

    Walking along `front` the body lies to the left. An open chain has walls at its two ends; a closed one is a ring whose
    inside is a courtyard (`hollow`) or is covered at the profile's last height. `profile` holds (t, height above the eave),
    t from 0 at the front to 1 at the back. `sides` says what stands where: "street", "yard", "party" or "blank", for all
    front edges, all back edges, then the two ends.
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
    look: str = "house"
    cover: str = "tiles"
    half_hip_m: float = 0.0
    lift_m: float | None = None


@dataclass(frozen=True)
class Lot:
    """The plan of one building: its parts and everything that is not geometry."""

    number: int
    kind: str
    function: str
    parts: tuple[Part, ...]
    street: str = ""
    house_number: int = 0
    extras: tuple[tuple[str, tuple[float, ...]], ...] = ()


@dataclass(frozen=True)
class Patch:
    """A piece of ground in the orthophoto; patches with higher `order` lie above."""

    polygon: Points
    material: str
    order: int


@dataclass(frozen=True)
class Tree:
    """A tree at (x, y): species, height in metres, turn in radians."""

    x: float
    y: float
    species: str
    height_m: float
    turn: float


@dataclass
class Plan:
    """Everything that stands and lies in a town; `radius_m` is half the side of its square ground."""

    lots: list[Lot] = field(default_factory=list)
    patches: list[Patch] = field(default_factory=list)
    trees: list[Tree] = field(default_factory=list)
    radius_m: float = 0.0

    def __getstate__(self) -> dict[str, Any]:
        """For other processes: the patches as four arrays, since there are hundreds of thousands."""
        corners = np.concatenate([patch.polygon for patch in self.patches]) if self.patches else np.zeros((0, 2))
        ends = np.cumsum([len(patch.polygon) for patch in self.patches], dtype=np.int64)
        rest = [patch.material for patch in self.patches], [patch.order for patch in self.patches]
        return {**self.__dict__, "patches": (corners, ends, *rest)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        corners, ends, materials, orders = state["patches"]
        polygons = np.split(corners, ends[:-1]) if len(ends) else []
        self.__dict__ |= {**state, "patches": list(map(Patch, polygons, materials, orders))}


@dataclass(frozen=True)
class Opening:
    """A window or a door in a wall: metres from the wall's lower left corner, seen from outside."""

    kind: str
    left_m: float
    low_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True, eq=False)
class Paint:
    """What is painted on a flat piece of `width_m` by `height_m`, in an area of its own of an atlas."""

    kind: str
    width_m: float
    height_m: float
    colors: tuple[tuple[int, int, int], ...]
    openings: tuple[Opening, ...] = ()
    floors_m: tuple[float, ...] = ()
    traits: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Wrap:
    """A repeating texture: its name and the metres that one repetition covers."""

    name: str
    size_m: float


@dataclass(frozen=True)
class Plain:
    """An untextured material by name."""

    name: str


@dataclass
class Face:
    """A flat polygon: rings (n, 3) without repeated last point, the first one outer; `st` the same in metres of its paint."""

    rings: list[Points]
    st: list[Points]
    paint: Paint | Wrap | Plain


@dataclass
class Surface:
    """A thematic surface with its polygons and the openings in it."""

    kind: str
    faces: list[Face]
    openings: list["Surface"] = field(default_factory=list)


@dataclass
class Body:
    """The geometry of a part: a closed shell, surfaces beyond it, and installations (function code, surfaces)."""

    shell: list[Surface]
    beyond: list[Surface] = field(default_factory=list)
    installations: list[tuple[str, list[Surface]]] = field(default_factory=list)
    base_z: float = 0.0
    top_z: float = 0.0
