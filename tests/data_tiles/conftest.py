"""A town rendered twice, with PNG layers and with data tiles, for tests that compare the two."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.web.server.asgi_app import create_app
from map3d_town import TownSpec, make_town
from tests.data_tiles.towns import RES_M, VIEW
from tests.web.conftest import Client


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The renderings `png` and `tile`, named after their `--data`, of one scene and one view; ambient occlusion is a pass of its own. For tests that
    only read."""
    files, root = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("workspace")
    make_town(files, TownSpec(buildings=4, seed=5, texture_px=256, trees=False), None)
    commands = [["create-scene", "town"], ["add-files", "town", str(files)]]
    for data in ("png", "tile"):
        commands += [
            ["create-rendering", "town", data, "--view", VIEW, "--res", RES_M, "--data", data],
            ["add-layers", data, "--layers", "ao"],
            ["render", data],
        ]
    for command in commands:
        assert run([*command, "-w", str(root)]) == 0, command
    return Workspace(root)


@pytest.fixture
def workspace(rendered: Workspace, tmp_path: Path) -> Workspace:
    return Workspace(Path(shutil.copytree(rendered.root, tmp_path / "ws")))


@pytest.fixture
def client(workspace: Workspace) -> Iterator[Client]:
    made = Client(create_app(workspace))
    yield made
    made.close()
