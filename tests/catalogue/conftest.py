"""Every test of the contract runs on every implementation."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, SceneRecord, open_catalogue
from tests.catalogue.implementations import IMPLEMENTATIONS, LEASE_S, NewUrl, new_urls, rendering


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Marks the slow tests with lost answers: those that wait for leases or make many catalogues. Others do the same changes."""
    for item in items:
        given = getattr(item, "callspec", None)
        loses_answers = given is not None and given.params.get("new_url") == "mongodb-lost-answers"
        if loses_answers and {"brief_catalogue", "make_catalogue"} & set(item.fixturenames):  # type: ignore[attr-defined]
            item.add_marker(pytest.mark.endurance)


@pytest.fixture(params=IMPLEMENTATIONS)
def new_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[NewUrl]:
    """Returns the URL of another empty catalogue at each call."""
    with new_urls(request.param, request, tmp_path) as new:
        yield new


@pytest.fixture
def opened() -> Iterator[list[Catalogue]]:
    """Catalogues to close at the end of the test."""
    listed: list[Catalogue] = []
    yield listed
    for catalogue in listed:
        catalogue.close()


@pytest.fixture
def catalogue_url(new_url: NewUrl) -> str:
    """The URL of the catalogue that the fixtures `catalogue` and `open_catalogue` open."""
    return new_url()


@pytest.fixture
def open_at(catalogue_url: str, opened: list[Catalogue]) -> Callable[..., Catalogue]:
    """Opens the same catalogue any number of times, as separate processes would."""

    def open_one(lease_s: float = 60.0) -> Catalogue:
        opened.append(open_catalogue(catalogue_url, lease_s=lease_s))
        return opened[-1]

    return open_one


@pytest.fixture
def catalogue(open_at: Callable[..., Catalogue]) -> Catalogue:
    """A catalogue with a scene `town` and its rendering `town-a`, which has one view and no jobs. Leases do not expire during a test."""
    return _with_rendering(open_at())


@pytest.fixture
def brief_catalogue(open_at: Callable[..., Catalogue]) -> Catalogue:
    """A catalogue like `catalogue`, whose leases expire after LEASE_S."""
    return _with_rendering(open_at(LEASE_S))


@pytest.fixture
def make_catalogue(new_url: NewUrl, opened: list[Catalogue]) -> Callable[[], Catalogue]:
    """Makes any number of catalogues like `catalogue`."""

    def make() -> Catalogue:
        opened.append(_with_rendering(open_catalogue(new_url())))
        return opened[-1]

    return make


def _with_rendering(catalogue: Catalogue) -> Catalogue:
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    return catalogue
