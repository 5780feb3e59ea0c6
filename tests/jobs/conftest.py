"""A workspace with a planned rendering of 64 base blocks, and a folder that selects the faults of the test subprocess."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.jobs.town import Town, make_town


@pytest.fixture
def faults(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "faults"
    folder.mkdir()
    monkeypatch.setenv("MAP3D_TEST_FAULTS", str(folder))
    return folder


@pytest.fixture
def town(tmp_path: Path, faults: Path) -> Iterator[Town]:
    made = make_town(tmp_path / "workspace")
    yield made
    made.close()
