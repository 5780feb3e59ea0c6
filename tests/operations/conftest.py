from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.messages import table
from tests.operations.scenario import STARTED, Scenario, kill, open_scenario, published, run_all, town_zip


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return town_zip(tmp_path_factory.mktemp("archive") / "town.zip")


@pytest.fixture
def scenario(tmp_path: Path) -> Iterator[Scenario]:
    """A workspace with an empty scene `town`."""
    opened = open_scenario(tmp_path / "ws")
    yield opened
    codes = codes_of(opened)
    opened.catalogue.close()
    assert codes <= set(table()), "every message has a code of the table"


def codes_of(scenario: Scenario) -> set[str]:
    """Returns the codes of the stages, messages and log lines of operations."""
    said = [message for operation in scenario.catalogue.operations() for message in (operation.stage, operation.message) if message is not None]
    said += [line.text for operation in scenario.catalogue.operations() for line in scenario.catalogue.operation_log(operation.id)]
    return {code for message in said for code in message.codes}


@pytest.fixture(scope="session")
def undisturbed(archive: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The published files of a town whose operations nothing interrupted."""
    scenario = open_scenario(tmp_path_factory.mktemp("undisturbed") / "ws")
    run_all(scenario, archive)
    files = published(scenario)
    scenario.catalogue.close()
    return files


@pytest.fixture
def reached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The file that says that the subprocess of an operation has reached the point at which it pauses. Kills the test's workers at its end."""
    monkeypatch.setenv("MAP3D_TEST_REACHED", str(tmp_path / "reached"))
    yield tmp_path / "reached"
    while STARTED:
        kill(STARTED.pop())
