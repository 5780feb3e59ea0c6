"""Small documents and elevation models around one place, and what a scene of them has."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.coherence.import_files import import_files
from map3d.ingest.findings import Finding, findings
from map3d.ingest.import_options import ImportOptions
from map3d.scenes.build import build, open_scene
from map3d.types import Box
from tests.ingest.terrain import rasters
from tests.odd_cities.towns import HEAD, world_boxes

UTM = "EPSG:25832"
EAST, NORTH = 691_000.0, 5_336_000.0
STEP_M = 40.0
SIDE = 4
"""Rows of houses of a town, and houses in a row."""

Corner = tuple[float, float, float]


def slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The terrain of all tests: it rises by 1 m in 20 m to the east, from 505 m at EAST."""
    return 505.0 + (x - EAST) / 20.0 + 0.0 * y


def write_dem(path: Path, height: float = 0.0, factor: float = 1.0, crs: str = UTM) -> Path:
    """Writes an elevation model of 400 m × 400 m around a town, `height` above the slope."""
    path.parent.mkdir(parents=True, exist_ok=True)
    west, north = EAST - 100.0, NORTH + 300.0
    columns, rows = np.meshgrid(np.arange(80), np.arange(80))
    values = (slope(west + 5.0 * (columns + 0.5), north - 5.0 * (rows + 0.5)) + height) * factor
    return rasters.write(path, values[None].astype(np.float32), crs=crs, transform=rasters.from_bounds(west, north - 400, west + 400, north, 80, 80))


def write_photo(path: Path, crs: str = UTM) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    west, north = EAST - 100.0, NORTH + 300.0
    return rasters.write(path, rasters.colours(200, 200), crs=crs, transform=rasters.from_bounds(west, north - 400, west + 400, north, 200, 200))


@dataclass(frozen=True)
class House:
    name: str
    x: float
    y: float
    z: float
    height: float = 6.0


def town(prefix: str = "b", *, base: float | None = None, above: float = 0.0, factor: float = 1.0, side: int = SIDE) -> list[House]:
    """Returns houses whose bases lie `above` the slope, or at `base`; heights are multiplied by `factor`."""
    places = [(EAST + STEP_M * column, NORTH + STEP_M * row) for row in range(side) for column in range(side)]
    bases = [float(slope(np.array(x + 1.0), np.array(y))) + above if base is None else base for x, y in places]
    return [House(f"{prefix}{k}", x, y, z * factor, 6.0 * factor) for k, ((x, y), z) in enumerate(zip(places, bases, strict=True))]


def write_houses(path: Path, houses: Sequence[House], *, crs: str = UTM, lod: int = 2) -> Path:
    """Writes houses of 10 m × 8 m; of level of detail 2 with a ridge and a ground surface."""
    members = "".join(_building(house, lod) for house in houses)
    return _write(path, members, crs)


def write_flat(path: Path, kind: str, polygons: Mapping[str, Sequence[Corner]], *, crs: str = UTM, dimension: int = 3, lod: int = 1) -> Path:
    """Writes polygons as objects of a type, such as tran:Road; coordinates are metres from EAST, NORTH."""
    members = "".join(
        f'<core:cityObjectMember><{kind} gml:id="{name}"><{kind.split(":")[0]}:lod{lod}MultiSurface>{_surfaces([corners], dimension)}'
        f"</{kind.split(':')[0]}:lod{lod}MultiSurface></{kind}></core:cityObjectMember>"
        for name, corners in polygons.items()
    )
    return _write(path, members, crs)


def road(x: float, z: float = 0.0) -> list[Corner]:
    """Returns a road of 200 m × 10 m, from west to east."""
    return [(x, 20.0, z), (x + 200.0, 20.0, z), (x + 200.0, 30.0, z), (x, 30.0, z)]


def _write(path: Path, members: str, crs: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    envelope = f'<gml:boundedBy><gml:Envelope srsName="{crs}" srsDimension="3"/></gml:boundedBy>'
    spaces = ' xmlns:tran="http://www.opengis.net/citygml/transportation/2.0" xmlns:luse="http://www.opengis.net/citygml/landuse/2.0">'
    path.write_text(HEAD.rstrip().removesuffix(">") + spaces + envelope + members + "</core:CityModel>")
    return path


def _building(house: House, lod: int) -> str:
    x, y, z = house.x - EAST, house.y - NORTH, house.z
    low = [(x, y, z), (x + 10, y, z), (x + 10, y + 8, z), (x, y + 8, z)]
    high = [(a, b, z + house.height) for a, b, _ in low]
    walls = [[low[k], low[(k + 1) % 4], high[(k + 1) % 4], high[k]] for k in range(4)]
    if lod == 1:
        content = f"<bldg:lod1MultiSurface>{_surfaces([low[::-1], high, *walls], 3)}</bldg:lod1MultiSurface>"
    else:
        middle = [(x, y + 4, z + 1.5 * house.height), (x + 10, y + 4, z + 1.5 * house.height)]
        roofs = [[high[0], high[1], middle[1], middle[0]], [high[2], high[3], middle[0], middle[1]]]
        parts = [("GroundSurface", [low[::-1]]), ("RoofSurface", roofs), ("WallSurface", walls)]
        content = "".join(
            f"<bldg:boundedBy><bldg:{kind}><bldg:lod2MultiSurface>{_surfaces(faces, 3)}</bldg:lod2MultiSurface></bldg:{kind}></bldg:boundedBy>"
            for kind, faces in parts
        )
    return f'<core:cityObjectMember><bldg:Building gml:id="{house.name}">{content}</bldg:Building></core:cityObjectMember>\n'


def _surfaces(faces: Sequence[Sequence[Corner]], dimension: int) -> str:
    return f"<gml:MultiSurface>{''.join(_member(face, dimension) for face in faces)}</gml:MultiSurface>"


def _member(face: Sequence[Corner], dimension: int) -> str:
    corners = [(EAST + x, NORTH + y, z)[:dimension] for x, y, z in [*face, face[0]]]
    numbers = " ".join(f"{value:.4f}" for corner in corners for value in corner)
    ring = f'<gml:LinearRing><gml:posList srsDimension="{dimension}">{numbers}</gml:posList></gml:LinearRing>'
    return f"<gml:surfaceMember><gml:Polygon><gml:exterior>{ring}</gml:exterior></gml:Polygon></gml:surfaceMember>"


@dataclass(frozen=True)
class Scene:
    """A scene with imported files."""

    workspace: Workspace
    catalogue: Catalogue

    def add(self, *paths: Path, heights: str | None = None, clamp: Sequence[str] = (), unchanged: bool = False, height_unit: str = "auto") -> None:
        options = ImportOptions(heights=heights, clamp=tuple(clamp), skip_unchanged=unchanged, height_unit=height_unit)
        done = import_files(self.workspace, self.catalogue, "town", list(paths), options)
        assert not done.failed

    def said(self) -> dict[str, list[Finding]]:
        """Returns what is said of each asset, but for what concerns the file alone."""
        return {asset.name: findings(asset.report) for asset in self.catalogue.assets("town")}

    def codes(self) -> set[str]:
        return {found.reason.code for said in self.said().values() for found in said}

    def the(self, code: str) -> Finding:
        (found,) = (found for said in self.said().values() for found in said if found.reason.code == code)
        return found

    def boxes(self) -> dict[str, Box]:
        return world_boxes(self.workspace, "town")

    def build(self) -> tuple[Box, Mapping[str, int]]:
        """Returns the world box of what is drawn, and the counts of the build."""
        report = build(self.workspace, self.catalogue, "town", threads=1, max_memory_bytes=1 << 30)
        low, high = open_scene(self.workspace, "town").box
        origin = self.catalogue.scene("town").origin
        assert origin is not None
        corners = [tuple(value + start for value, start in zip(corner, origin, strict=True)) for corner in (low, high)]
        return (corners[0], corners[1]), report  # type: ignore[return-value]


@contextmanager
def new_scene(folder: Path) -> Iterator[Scene]:
    workspace = Workspace(folder / "workspace").create()
    with workspace.open_catalogue() as catalogue:
        catalogue.create_scene(SceneRecord("town"))
        yield Scene(workspace, catalogue)
