"""Types of a building's 3D model: boundary surfaces, faces and their materials."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from map3d_town.layout.town_plan import BuildingPlan
from map3d_town.polygons_2d import Points

Color = tuple[int, int, int]
WALL, ROOF, GROUND = "WallSurface", "RoofSurface", "GroundSurface"


@dataclass(frozen=True)
class Opening:
    """A window or door in a wall, in metres from the wall's lower left corner, seen from outside."""

    kind: str
    left_m: float
    low_m: float
    width_m: float
    height_m: float


@dataclass(frozen=True, eq=False)
class AtlasTexture:
    """The design of a texture for a flat area of `width_m` × `height_m`; it gets its own area of an atlas."""

    kind: str
    width_m: float
    height_m: float
    colors: tuple[Color, ...]
    openings: tuple[Opening, ...] = ()
    floors_m: tuple[float, ...] = ()
    traits: frozenset[str] = frozenset()


@dataclass(frozen=True)
class RepeatingTexture:
    """A repeating texture; one repetition covers `size_m`."""

    name: str
    size_m: float


@dataclass(frozen=True)
class PlainMaterial:
    """A material without texture."""

    name: str


SurfaceMaterial = AtlasTexture | RepeatingTexture | PlainMaterial


@dataclass
class TexturedFace:
    """A flat polygon: rings (n, 3), the outer one first, without repeated last point. `st`: the rings in metres of the texture."""

    rings: list[Points]
    st: list[Points]
    material: SurfaceMaterial


@dataclass
class BoundarySurface:
    """A wall, roof, ground surface, window or door: its faces and its openings."""

    kind: str
    faces: list[TexturedFace]
    openings: list["BoundarySurface"] = field(default_factory=list)


@dataclass
class PartGeometry:
    """The geometry of a building part: a closed shell, the eaves outside it, and installations as (function code, surfaces)."""

    shell: list[BoundarySurface]
    overhangs: list[BoundarySurface] = field(default_factory=list)
    installations: list[tuple[str, list[BoundarySurface]]] = field(default_factory=list)
    base_z: float = 0.0
    top_z: float = 0.0


@dataclass(frozen=True)
class BuildingModel:
    """A building with the geometry of its parts; `deep`: its openings are modelled and recessed."""

    plan: BuildingPlan
    bodies: tuple[PartGeometry, ...]
    ground_z: float
    deep: bool

    def faces(self) -> Iterator[TexturedFace]:
        """Yields every face, openings included."""
        for body in self.bodies:
            groups = [body.shell, body.overhangs, *(surfaces for _, surfaces in body.installations)]
            for surface in (s for group in groups for s in group):
                yield from surface.faces
                for opening in surface.openings:
                    yield from opening.faces
