"""Cities of several sizes for the viewer's benchmark: rings of 512 m cells around one district, each cell with its own assets (bench/district.py).

The central cell and its neighbours are the plain district (80 buildings, elevations every 12.8 m). Outer rings have the same buildings with
modelled windows and finer elevations, so that ten million triangles fit in 6.7 km. The central cell is identical in all cities.
"""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from map3d.catalogue import Workspace
from map3d_town import TownSpec, make_town

from .benchmark_scene import run_verb
from .district import DistrictCopier

CELL_M = 512.0
SPECS = {
    "plain": TownSpec(buildings=80, seed=7, textures=8, texture_px=1024, trees=False, deep_share=0.0, dem_m=12.8, ortho_m=0.2),
    "dense": TownSpec(buildings=80, seed=7, textures=8, texture_px=1024, trees=False, deep_share=1.0, dem_m=3.7, ortho_m=0.2),
}
RINGS = {"1e4": 0, "1e5": 1, "1e6": 2, "1e7": 6}
"""Number of rings around the central cell."""
PLAIN_RINGS = 1
RES_M, ZMAX = 0.18, {"1e4": 4, "1e5": 6, "1e6": 6, "1e7": 8}
VIEWS = ("0/45", "90/45")
GridCell = tuple[int, int]


@dataclass(frozen=True)
class City:
    """A city of one size; `name`: a key of RINGS."""

    name: str
    folder: Path

    @property
    def published(self) -> Path:
        return self.folder / "published" / self.name

    @property
    def cells(self) -> dict[GridCell, str]:
        """The kind of district of each cell (column, row), the central cell first."""
        reach = RINGS[self.name]
        span = range(-reach, reach + 1)
        found = sorted(((column, row) for column in span for row in span), key=lambda at: (ring_of(at), at))
        return {at: "plain" if ring_of(at) <= PLAIN_RINGS else "dense" for at in found}

    @property
    def triangles(self) -> int:
        return int(json.loads((self.published / "bench.json").read_text())["triangles"])


def ring_of(cell: GridCell) -> int:
    return max(abs(cell[0]), abs(cell[1]))


def publish_cities(folder: Path, names: tuple[str, ...]) -> Iterator[City]:
    """Publishes the cities in the order of `names`, and yields them; keeps those of earlier runs."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        city = City(name, folder)
        if not (city.published / "bench.json").is_file():
            _publish(city)
        yield city


def import_district(folder: Path, kind: str) -> tuple[Workspace, str]:
    """Returns the workspace and the scene of a kind of district; imports it the first time."""
    workspace = Workspace(folder / "workspace").create()
    town, where = folder / f"town-{kind}", ["-w", str(workspace.root)]
    catalogue = workspace.open_catalogue()
    scenes = {scene.name: len(catalogue.assets(scene.name)) for scene in catalogue.scenes()}
    catalogue.close()
    if kind not in scenes:
        run_verb(["create-scene", kind, *where])
    if not scenes.get(kind):
        _log(f"district {kind}")
        make_town(town, SPECS[kind], workers=2)
        run_verb(["add-files", kind, str(town), *where])
    return workspace, kind


def assets_of(folder: Path, kind: str) -> list[Path]:
    """Returns the asset folders of a kind of district."""
    workspace, scene = import_district(folder, kind)
    with workspace.open_catalogue() as catalogue:
        return [workspace.asset_folder(scene, asset.name) for asset in catalogue.assets(scene)]


def city_centre(kind: str = "plain") -> tuple[float, float]:
    """Returns east and north of the centre of the city."""
    return SPECS[kind].east_m, SPECS[kind].north_m


def _publish(city: City) -> None:
    kinds = sorted({*city.cells.values()}, reverse=True)
    workspace = {kind: import_district(city.folder, kind)[0] for kind in kinds}[kinds[0]]
    scene, where = f"city-{city.name}", ["-w", str(workspace.root)]
    catalogue = workspace.open_catalogue()
    there = {known.name for known in catalogue.scenes()}
    catalogue.close()
    if scene not in there:
        run_verb(["create-scene", scene, *where])
    triangles = _add_missing_cells(city, workspace, scene)
    rendering = f"view-{city.name}"
    catalogue = workspace.open_catalogue()
    renderings = {known.name for known in catalogue.renderings()}
    catalogue.close()
    if rendering not in renderings:
        east, north = city_centre()
        window = ["--levels", str(ZMAX[city.name] + 1), "--window", f"{east},{north},{256 * RES_M * 2 ** ZMAX[city.name]}"]
        views = [word for view in VIEWS for word in ("--view", view)]
        _log(f"{scene}: build")
        run_verb(["create-rendering", scene, rendering, *views, *window, "--title", f"City of {triangles:,} triangles", *where])
    _log(f"{scene}: render")
    run_verb(["render", rendering, *where])
    run_verb(["publish", rendering, "-o", str(city.published), *where])
    (city.published / "bench.json").write_text(json.dumps({"triangles": triangles, "places": len(city.cells)}))


def _add_missing_cells(city: City, workspace: Workspace, scene: str) -> int:
    """Adds the missing cells to the city's scene; returns its number of triangles."""
    with workspace.open_catalogue() as catalogue:
        there = {asset.name for asset in catalogue.assets(scene)}
        each = {kind: catalogue.assets(kind) for kind in set(city.cells.values())}
        total = sum(sum(asset.report["triangles"] for asset in each[kind]) for kind in city.cells.values())
        for number, (at, kind) in enumerate(city.cells.items()):
            if all(f"d{number:04d}-{asset.name}" in there for asset in each[kind]):
                continue
            _log(f"{scene}: cell {number + 1} of {len(city.cells)}")
            offset = np.array([*(CELL_M * step for step in at), 0.0])
            DistrictCopier(workspace, kind, scene, CELL_M).add_copy_at(catalogue, number, offset)
        return total


def _log(what: Any) -> None:
    print(f"bench: {what}", file=sys.stderr, flush=True)
