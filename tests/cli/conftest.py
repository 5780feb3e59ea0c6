"""The command line in this process, with its own workspace and folder."""

from pathlib import Path

import pytest

from map3d.cli import app
from tests.cli.towns import Run


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Runs a command line and returns (status, output, errors)."""
    monkeypatch.setenv("MAP3D_WORKSPACE", str(tmp_path / "workspace"))
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        status = app.run(list(arguments))
        captured = capfd.readouterr()
        return status, captured.out, captured.err

    return call
