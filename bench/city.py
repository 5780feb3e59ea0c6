"""Cities that grow around one district, for the viewer's benchmark: places of 512 m in rings, each an asset of its own (bench/district.py).

The middle place and those next to it are the plain district (80 buildings, elevations every 12.8 m); further rings are the same buildings with
windows that are modelled and finer elevations, so that ten million triangles need 6.7 km. The middle is the same in all of them, down to its texels.
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

from .district import Copies
from .scene import _do

PLACE_M = 512.0
SPECS = {
    "plain": TownSpec(buildings=80, seed=7, textures=8, texture_px=1024, trees=False, deep_share=0.0, dem_m=12.8, ortho_m=0.2),
    "dense": TownSpec(buildings=80, seed=7, textures=8, texture_px=1024, trees=False, deep_share=1.0, dem_m=3.7, ortho_m=0.2),
}
RINGS = {"1e4": 0, "1e5": 1, "1e6": 2, "1e7": 6}
"""How many rings of places lie around the middle."""
PLAIN_RINGS = 1
RES_M, ZMAX = 0.18, {"1e4": 4, "1e5": 6, "1e6": 6, "1e7": 8}
VIEWS = ("0/45", "90/45")
Place = tuple[int, int]


@dataclass(frozen=True)
class City:
    """One size and where everything of it lies. `name`: a key of RINGS."""

    name: str
    folder: Path

    @property
    def published(self) -> Path:
        return self.folder / "published" / self.name

    @property
    def places(self) -> dict[Place, str]:
        """Column and row of each place, its kind of district; the middle comes first."""
        reach = RINGS[self.name]
        span = range(-reach, reach + 1)
        found = sorted(((column, row) for column in span for row in span), key=lambda at: (ring(at), at))
        return {at: "plain" if ring(at) <= PLAIN_RINGS else "dense" for at in found}

    @property
    def triangles(self) -> int:
        return int(json.loads((self.published / "bench.json").read_text())["triangles"])


def ring(place: Place) -> int:
    return max(abs(place[0]), abs(place[1]))


def made(folder: Path, names: tuple[str, ...]) -> Iterator[City]:
    """The cities, published, smallest first; what an earlier run has finished stays."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        city = City(name, folder)
        if not (city.published / "bench.json").is_file():
            _make(city)
        yield city


def district(folder: Path, kind: str) -> tuple[Workspace, str]:
    """The workspace and the scene of a kind of district, made once."""
    workspace = Workspace(folder / "workspace").create()
    town, where = folder / f"town-{kind}", ["-w", str(workspace.root)]
    catalogue = workspace.open_catalogue()
    scenes = {scene.name: len(catalogue.assets(scene.name)) for scene in catalogue.scenes()}
    catalogue.close()
    if kind not in scenes:
        _do(["create-scene", kind, *where])
    if not scenes.get(kind):
        _say(f"district {kind}")
        make_town(town, SPECS[kind], workers=2)
        _do(["add-files", kind, str(town), *where])
    return workspace, kind


def assets_of(folder: Path, kind: str) -> list[Path]:
    """The asset folders of a kind of district."""
    workspace, scene = district(folder, kind)
    catalogue = workspace.open_catalogue()
    try:
        return [workspace.asset_folder(scene, asset.name) for asset in catalogue.assets(scene)]
    finally:
        catalogue.close()


def middle(kind: str = "plain") -> tuple[float, float]:
    """East and north of the middle of the middle place."""
    return SPECS[kind].east_m, SPECS[kind].north_m


def _make(city: City) -> None:
    kinds = sorted({*city.places.values()}, reverse=True)
    workspace = {kind: district(city.folder, kind)[0] for kind in kinds}[kinds[0]]
    scene, where = f"city-{city.name}", ["-w", str(workspace.root)]
    catalogue = workspace.open_catalogue()
    there = {known.name for known in catalogue.scenes()}
    catalogue.close()
    if scene not in there:
        _do(["create-scene", scene, *where])
    triangles = _fill(city, workspace, scene)
    rendering = f"view-{city.name}"
    catalogue = workspace.open_catalogue()
    renderings = {known.name for known in catalogue.renderings()}
    catalogue.close()
    if rendering not in renderings:
        east, north = middle()
        window = ["--levels", str(ZMAX[city.name] + 1), "--window", f"{east},{north},{256 * RES_M * 2 ** ZMAX[city.name]}"]
        views = [word for view in VIEWS for word in ("--view", view)]
        _say(f"{scene}: build")
        _do(["create-rendering", scene, rendering, *views, *window, "--title", f"City of {triangles:,} triangles", *where])
    _say(f"{scene}: render")
    _do(["render", rendering, *where])
    _do(["publish", rendering, "-o", str(city.published), "--replace", *where])
    (city.published / "bench.json").write_text(json.dumps({"triangles": triangles, "places": len(city.places)}))


def _fill(city: City, workspace: Workspace, scene: str) -> int:
    """Puts what is missing of a city's places into its scene; returns its triangles."""
    catalogue = workspace.open_catalogue()
    try:
        there = {asset.name for asset in catalogue.assets(scene)}
        each = {kind: catalogue.assets(kind) for kind in set(city.places.values())}
        total = sum(sum(asset.report["triangles"] for asset in each[kind]) for kind in city.places.values())
        for number, (at, kind) in enumerate(city.places.items()):
            if all(f"d{number:04d}-{asset.name}" in there for asset in each[kind]):
                continue
            _say(f"{scene}: place {number + 1} of {len(city.places)}")
            offset = np.array([*(PLACE_M * step for step in at), 0.0])
            Copies(workspace, kind, scene, PLACE_M).put_at(catalogue, number, offset)
        return total
    finally:
        catalogue.close()


def _say(what: Any) -> None:
    print(f"bench: {what}", file=sys.stderr, flush=True)
