"""Every test of the contract runs on every implementation."""

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, SceneRecord
from tests.catalogue.implementations import IMPLEMENTATIONS, LEASE_S, rendering

Open = Callable[[float], Catalogue]


@pytest.fixture(params=sorted(IMPLEMENTATIONS))
def new_database(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[], Open]:
    """Creates an empty database, which the returned function opens any number of times."""
    numbers = count()

    def new() -> Open:
        folder = tmp_path / f"database-{next(numbers)}"
        folder.mkdir()
        return IMPLEMENTATIONS[request.param](folder)

    return new


@pytest.fixture
def opened() -> Iterator[list[Catalogue]]:
    """Catalogues to close at the end of the test."""
    listed: list[Catalogue] = []
    yield listed
    for catalogue in listed:
        catalogue.close()


@pytest.fixture
def open_catalogue(new_database: Callable[[], Open], opened: list[Catalogue]) -> Callable[..., Catalogue]:
    """Opens the same catalogue any number of times, as separate processes would."""
    database = new_database()

    def open_one(lease_s: float = 60.0) -> Catalogue:
        opened.append(database(lease_s))
        return opened[-1]

    return open_one


@pytest.fixture
def catalogue(open_catalogue: Callable[..., Catalogue]) -> Catalogue:
    """A catalogue with a scene `town` and its rendering `town-a`, which has one view and no jobs. Leases do not expire during a test."""
    return _with_rendering(open_catalogue())


@pytest.fixture
def brief_catalogue(open_catalogue: Callable[..., Catalogue]) -> Catalogue:
    """A catalogue like `catalogue`, whose leases expire after LEASE_S."""
    return _with_rendering(open_catalogue(LEASE_S))


@pytest.fixture
def make_catalogue(new_database: Callable[[], Open], opened: list[Catalogue]) -> Callable[[], Catalogue]:
    """Makes any number of catalogues like `catalogue`."""

    def make() -> Catalogue:
        opened.append(_with_rendering(new_database()(60.0)))
        return opened[-1]

    return make


def _with_rendering(catalogue: Catalogue) -> Catalogue:
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    return catalogue
