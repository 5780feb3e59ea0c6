"""The three scripts with the names of map3d's predecessor, as installed next to the interpreter."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from map3d.cli.app import run
from map3d_town.teatime import write_teatime

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

SCRIPTS = Path(sys.executable).parent


def test_scripts_create_a_scene_that_renders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("MAP3D_WORKSPACE", str(tmp_path / "workspace"))
    monkeypatch.chdir(tmp_path)
    write_teatime(tmp_path / "files")
    for arguments in (
        ("createScene.py", "teatime"),
        ("addFilesToScene.py", "teatime", "files/teapot.obj", "files/cube.obj"),
        ("createRendering.py", "teatime", "teatime", "--view", "45/22.5", "--layers", "color,normal,id,depth", "--res", "0.5"),
    ):
        script = SCRIPTS / arguments[0]
        assert os.access(script, os.X_OK), f"{script} is not installed: make build, or pip install"
        subprocess.run([script, *arguments[1:]], check=True)
    assert run(["render", "teatime"]) == 0
    assert "teatime is complete" in capfd.readouterr().out


def test_script_reports_errors_like_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAP3D_WORKSPACE", str(tmp_path / "workspace"))
    done = subprocess.run([SCRIPTS / "addFilesToScene.py", "nowhere", "nothing.obj"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("map3d: ")
    assert done.stderr.count("\n") == 1
