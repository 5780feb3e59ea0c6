"""map3d demo, and the address that map3d serve prints."""

import sys
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.cli.demo import NAME, SCENE, remaining_steps
from map3d.cli.serve import page_path
from map3d.errors import NotFound
from tests.cli.towns import Run, write_town


def commands(workspace: Workspace, folder: Path) -> list[str]:
    return [arguments[0] for _, arguments in remaining_steps(workspace, folder)]


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


def test_demo_skips_completed_steps(run: Run, workspace: Workspace, tmp_path: Path) -> None:
    files = write_town(tmp_path / "files", 1)
    assert commands(workspace, files) == ["make-town", "create-scene", "add-files", "create-rendering", "render"]
    run("create-scene", SCENE)
    assert commands(workspace, files) == ["make-town", "add-files", "create-rendering", "render"]
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
    run("add-files", SCENE, str(files))
    run("create-rendering", SCENE, NAME, "--res", "1")
    assert commands(workspace, files) == ["make-town", "render"]


def test_demo_without_serve_ends_with_a_complete_rendering(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
    demo = sys.modules["map3d.cli.demo"]
    monkeypatch.setattr(demo, "TOWN", ("--buildings", "2", "--no-terrain", "--no-trees", "--texture-px", "256"))
    monkeypatch.setattr(demo, "RES_M", "2")
    status, out, err = run("demo", "--folder", str(tmp_path / "demo"), "--no-serve")
    assert status == 0, err
    assert "== rendering the tiles: map3d render demo" in out
    assert "demo is complete" in out
    catalogue = Workspace(tmp_path / "demo" / "workspace").open_catalogue()
    views = [frame.id for frame in catalogue.rendering(NAME).frames]
    catalogue.close()
    assert views == ["0-45", "45-45", "90-45", "135-45", "180-45", "225-45", "270-45", "315-45", "0-90"]
    status, out, err = run("demo", "--folder", str(tmp_path / "demo"), "--no-serve")
    assert (status, "rendered 0 blocks" in out) == (0, True), err


def test_serve_prints_the_address_of_the_only_map(run: Run, workspace: Workspace, tmp_path: Path) -> None:
    assert page_path(workspace, None) == ""
    with pytest.raises(NotFound, match="no rendering 'town'"):
        page_path(workspace, "town")
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
    run("create-scene", "town")
    run("add-files", "town", str(write_town(tmp_path / "files", 1)))
    run("create-rendering", "town", "a", "--res", "1")
    assert page_path(workspace, None) == page_path(workspace, "a") == "view/a/"
    run("create-rendering", "town", "b", "--res", "1")
    assert page_path(workspace, None) == ""
    assert page_path(workspace, "b") == "view/b/"
