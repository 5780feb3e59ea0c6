"""One town for all tests: generated, imported, rendered and served by the command line."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.cli.app import run
from map3d_town import TownSpec, make_town
from tests.whole.browsing import served


@pytest.fixture(scope="session")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rendering `town` of a scene `town` with four look-at angles."""
    files, root = tmp_path_factory.mktemp("files"), tmp_path_factory.mktemp("workspace")
    make_town(files, TownSpec(buildings=12, seed=5, texture_px=256, trees=False), None)
    where = ["-w", str(root)]
    for command in (
        ["create-scene", "town", *where],
        ["add-files", "town", str(files), *where],
        ["create-rendering", "town", "town", "--res", "0.4", "--directions", "4", *where],
        ["render", "town", *where],
        ["verify", "town", *where],
    ):
        assert run(command) == 0, command
    return root


@pytest.fixture(scope="session")
def origin(workspace: Path) -> Iterator[str]:
    with served(workspace) as address:
        yield address
