"""Every test of the contract runs on every home."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, SceneRecord
from tests.catalogue.homes import HOMES, LEASE_S, rendering


@pytest.fixture(params=sorted(HOMES))
def open_home(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Catalogue]]:
    """Opens the same home any number of times, as separate processes would."""
    opened: list[Catalogue] = []

    def open_one(lease_s: float = LEASE_S) -> Catalogue:
        opened.append(HOMES[request.param](tmp_path)(lease_s))
        return opened[-1]

    yield open_one
    for catalogue in opened:
        catalogue.close()


@pytest.fixture
def catalogue(open_home: Callable[..., Catalogue]) -> Catalogue:
    """With a scene `town` and its rendering `town-a` of one view, without jobs."""
    home = open_home()
    home.create_scene(SceneRecord("town"))
    home.create_rendering(rendering())
    return home
