from collections.abc import Iterator
from pathlib import Path

import pytest

from map3d.catalogue import OperationState
from map3d.web.studio.operation_sentences import find_sentence
from tests.operations.scenario import STARTED, Scenario, kill, open_scenario, published, run_all, town_zip


@pytest.fixture(scope="session")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return town_zip(tmp_path_factory.mktemp("archive") / "town.zip")


@pytest.fixture
def scenario(tmp_path: Path) -> Iterator[Scenario]:
    """A workspace with an empty scene `town`."""
    opened = open_scenario(tmp_path / "ws")
    yield opened
    unknown = texts_without_sentence(opened)
    opened.catalogue.close()
    assert unknown == [], "map3d.web.studio.operation_sentences has every text, so that pages can translate it"


def texts_without_sentence(scenario: Scenario) -> list[str]:
    """Returns the stages, messages and log lines of operations that pages cannot translate; the reasons of errors are not among them."""
    found = []
    for operation in scenario.catalogue.operations():
        ends = [] if operation.state is OperationState.FAILED else [operation.message]
        lines = [line.text for line in scenario.catalogue.operation_log(operation.id)]
        found += [text for text in (operation.stage, *ends, *lines) if text and find_sentence(text) is None]
    return found


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
