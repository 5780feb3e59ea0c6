"""Scenes for the oracle, built by the command line."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from map3d import _core
from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.geometry.core_frame import core_frame
from map3d.tiles.occupancy import xy_from_morton
from map3d_town import TownSpec, make_town

from .asset_reader import OracleAsset, read_asset


@dataclass(frozen=True, eq=False)
class OracleScene:
    """A built scene and a rendering of it: fields of frames by view id."""

    folder: Path
    scene: _core.Scene
    assets: list[OracleAsset]
    frames: dict[str, dict]

    def texture(self, asset: OracleAsset, material: dict) -> np.ndarray | None:
        """Returns (H, W, 3) uint8: the source image with filled unused texels, which bilinear lookups at borders would otherwise read."""
        if material["texture"] is None:
            return None
        return self._filled()[material["texture"]]

    def _filled(self) -> dict[str, np.ndarray]:
        if not hasattr(self, "_cache"):
            object.__setattr__(self, "_cache", _levels(self.folder))
        return self._cache

    def busiest_tiles(self, view: str, count: int) -> list[tuple[int, int]]:
        """Returns the base tiles (x, y) with the most objects, weighted by coverage."""
        return _busiest(self, view)[:count]


@cache
def _busiest(built: OracleScene, view: str) -> list[tuple[int, int]]:
    """Sorts about 64 evenly spaced occupied tiles by number of objects times coverage."""
    frame = core_frame(built.frames[view])
    columns, lines = xy_from_morton(built.scene.occupied(frame, frame.zmax))
    tiles = sorted(zip(lines, columns, strict=True))
    step = max(1, len(tiles) // 64)
    rows = []
    for y, x in tiles[::step]:
        ids = built.scene.gbuffer(frame, int(x), int(y))["id"]
        rows.append((len(np.unique(ids)) * (ids > 0).mean(), int(x), int(y)))
    return [(x, y) for _, x, y in sorted(rows, reverse=True)]


def _levels(folder: Path) -> dict[str, np.ndarray]:
    """Returns level 0 of each texture by key of its source image."""
    import hashlib

    found = {}
    for path in sorted((folder / "textures").glob("*/*.m3t")):
        data = path.read_bytes()
        offset, length = np.frombuffer(data, "<u8", 2, 64)
        found[hashlib.sha256(data[offset : offset + length]).hexdigest()[:32]] = _core.texture_level(str(path), 0)[..., :3]
    return found


Builder = Callable[..., OracleScene]


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Builder:
    """Returns a function build(name, files, res_m, views) → OracleScene."""

    def make(name: str, files: list[Path], res_m: float, views: list[str]) -> OracleScene:
        workspace = tmp_path_factory.mktemp(name)
        where = ["-w", str(workspace)]
        # The oracle knows the colours of materials.json alone, in which surfaces without a colour have this grey.
        style = workspace / "style.json"
        style.write_text('{"rules": [{"color": "#cccccc"}]}')
        commands = [
            ["create-scene", name, "--style", str(style), *where],
            ["add-files", name, *map(str, files), *where],
            ["create-rendering", name, name, "--res", str(res_m), *[part for view in views for part in ("--view", view)], *where],
        ]
        for command in commands:
            assert run(command) == 0, command
        folder = workspace / "scenes" / name
        assets = [read_asset(path.parent) for path in sorted(folder.glob("assets/*/mesh.m3a"))]
        return OracleScene(folder, _core.Scene(str(folder)), assets, _frames(workspace, name))

    return make


def _frames(workspace: Path, rendering: str) -> dict[str, dict]:
    catalogue = Workspace(workspace).open_catalogue()
    try:
        record = catalogue.rendering(rendering)
        return {track.id: track.frame.to_json(track.layers) for track in record.tracks}
    finally:
        catalogue.close()


@pytest.fixture(scope="session")
def town(build: Builder, tmp_path_factory: pytest.TempPathFactory) -> OracleScene:
    out = tmp_path_factory.mktemp("town-files")
    make_town(out, TownSpec(buildings=40, seed=3, trees=False, terrain=False, texture_px=512), None)
    return build("town", sorted(out.glob("citygml/*.gml")), 0.1, ["30/10", "30/22.5", "30/45", "30/90"])


@pytest.fixture(scope="session")
def ingolstadt(build: Builder) -> OracleScene:
    data = os.environ.get("MAP3D_DATA")
    if not data:
        pytest.skip("set MAP3D_DATA for tests with a real city")
    return build("ingolstadt", [Path(data, "citygml-ingolstadt-lod3")], 0.1, ["30/10", "30/22.5", "30/45", "30/90"])
