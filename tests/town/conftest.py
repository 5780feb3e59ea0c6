"""Small towns that the tests share."""

from pathlib import Path

import pytest

from map3d_town import make_town
from tests.town.documents import ROMAN, TOWN


@pytest.fixture(scope="session")
def town(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A European town of 14 buildings with everything."""
    out = tmp_path_factory.mktemp("town")
    make_town(out, TOWN)
    return out


@pytest.fixture(scope="session")
def roman(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Roman town of 90 buildings, CityGML only."""
    out = tmp_path_factory.mktemp("roman")
    make_town(out, ROMAN)
    return out


@pytest.fixture(scope="session", params=["town", "roman"])
def either(request: pytest.FixtureRequest, town: Path, roman: Path) -> Path:
    return town if request.param == "town" else roman
