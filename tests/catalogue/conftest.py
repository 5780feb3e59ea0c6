"""Every test of the contract runs on every implementation."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, SceneRecord
from tests.catalogue.implementations import IMPLEMENTATIONS, LEASE_S, rendering


@pytest.fixture(params=sorted(IMPLEMENTATIONS))
def open_catalogue(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Callable[..., Catalogue]]:
    """Opens the same catalogue any number of times, as separate processes would."""
    opened: list[Catalogue] = []

    def open_one(lease_s: float = LEASE_S) -> Catalogue:
        opened.append(IMPLEMENTATIONS[request.param](tmp_path)(lease_s))
        return opened[-1]

    yield open_one
    for catalogue in opened:
        catalogue.close()


@pytest.fixture
def catalogue(open_catalogue: Callable[..., Catalogue]) -> Catalogue:
    """A catalogue with a scene `town` and its rendering `town-a`, which has one view and no jobs."""
    opened = open_catalogue()
    opened.create_scene(SceneRecord("town"))
    opened.create_rendering(rendering())
    return opened
