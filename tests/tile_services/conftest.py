"""A real town, rendered and served, for tests with the real clients."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.tiles.manifest import Manifest
from map3d_town import TownSpec, make_town
from tests.tile_services.pyramid_pixels import PyramidPixels
from tests.whole.browsing import served

RENDERING, VIEW = "lit", "35-40"


@pytest.fixture(scope="session")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rendering `lit` with the layers picture, color, id and depth of one view."""
    files, root = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("workspace")
    make_town(files, TownSpec(buildings=12, seed=5, texture_px=256, trees=False), None)
    where = ["-w", str(root)]
    layers = ["--view", VIEW, "--layers", "picture,color,normal,id,depth", "--time", "2026-06-21T15:00+02:00"]
    for command in (
        ["create-scene", "town", *where],
        ["add-files", "town", str(files), *where],
        ["create-rendering", "town", RENDERING, "--res", "0.4", *layers, "--title", "Lit <town>", "--attribution", "Town & Co", *where],
        ["render", RENDERING, *where],
    ):
        assert run(command) == 0, command
    return root


@pytest.fixture(scope="session")
def pixels(town: Path) -> PyramidPixels:
    workspace = Workspace(town)
    manifest = Manifest.load(workspace.manifest_path(RENDERING).read_bytes())
    return PyramidPixels(workspace, manifest, VIEW)


@pytest.fixture(scope="session")
def address(town: Path) -> Iterator[str]:
    with served(town) as address:
        yield address
