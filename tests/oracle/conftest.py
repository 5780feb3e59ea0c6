"""Scenes for the oracles: built by the command line, as a user would."""

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
from map3d.geometry.frames import core_frame
from map3d.tiles.occupancy import xy_from_morton
from map3d_town import TownSpec, make_town

from .asset import Asset, read_asset

pytest.importorskip("mitsuba", reason="the oracle needs Mitsuba 3: pip install map3d[peers]")


@dataclass(frozen=True, eq=False)
class Built:
    """A built scene and a rendering of it: fields of frames by view id."""

    folder: Path
    scene: _core.Scene
    assets: list[Asset]
    frames: dict[str, dict]

    def texture(self, asset: Asset, material: dict) -> np.ndarray | None:
        """(H, W, 3) uint8 as the source has it, unused texels filled: bilinear lookups at the border of a used part would else meet them."""
        if material["texture"] is None:
            return None
        return self._filled()[material["texture"]]

    def _filled(self) -> dict[str, np.ndarray]:
        if not hasattr(self, "_cache"):
            object.__setattr__(self, "_cache", _levels(self.folder))
        return self._cache

    def busiest_tiles(self, view: str, count: int) -> list[tuple[int, int]]:
        """Base tiles (x, y) with the most objects in them, weighted by the share that is covered."""
        return _busiest(self, view)[:count]


@cache
def _busiest(built: Built, view: str) -> list[tuple[int, int]]:
    """Samples 64 evenly spaced occupied tiles, enough to locate the town."""
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
    """Level 0 of each texture by the key of its source image."""
    import hashlib

    found = {}
    for path in sorted((folder / "textures").glob("*/*.m3t")):
        data = path.read_bytes()
        offset, length = np.frombuffer(data, "<u8", 2, 64)
        found[hashlib.sha256(data[offset : offset + length]).hexdigest()[:32]] = _core.texture_level(str(path), 0)[..., :3]
    return found


Builder = Callable[..., Built]


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Builder:
    """build(name, files, res_m, views) → Built."""

    def make(name: str, files: list[Path], res_m: float, views: list[str]) -> Built:
        workspace = tmp_path_factory.mktemp(name)
        where = ["-w", str(workspace)]
        commands = [
            ["create-scene", name, *where],
            ["add-files", name, *map(str, files), *where],
            ["create-rendering", name, name, "--res", str(res_m), *[part for view in views for part in ("--view", view)], *where],
        ]
        for command in commands:
            assert run(command) == 0, command
        folder = workspace / "scenes" / name
        assets = [read_asset(path.parent) for path in sorted(folder.glob("assets/*/mesh.m3a"))]
        return Built(folder, _core.Scene(str(folder)), assets, _frames(workspace, name))

    return make


def _frames(workspace: Path, rendering: str) -> dict[str, dict]:
    catalogue = Workspace(workspace).open_catalogue()
    try:
        record = catalogue.rendering(rendering)
        return {track.id: track.frame.to_json(track.layers) for track in record.tracks}
    finally:
        catalogue.close()


@pytest.fixture(scope="session")
def town(build: Builder, tmp_path_factory: pytest.TempPathFactory) -> Built:
    out = tmp_path_factory.mktemp("town-files")
    make_town(out, TownSpec(buildings=40, seed=3, trees=False, terrain=False, texture_px=512), None)
    return build("town", sorted(out.glob("citygml/*.gml")), 0.1, ["30/10", "30/22.5", "30/45", "30/90"])


@pytest.fixture(scope="session")
def ingolstadt(build: Builder) -> Built:
    data = os.environ.get("MAP3D_DATA")
    if not data:
        pytest.skip("MAP3D_DATA is not set: no real city here")
    return build("ingolstadt", [Path(data, "citygml-ingolstadt-lod3")], 0.1, ["30/10", "30/22.5", "30/45", "30/90"])
