"""Imports that are killed at any point leave no drafts, and a scene whose folder, registry and catalogue agree."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.ingest.asset import asset_digest
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import import_file
from map3d.ingest.sources import find_sources
from map3d.registry import Registry
from map3d.scenes.build import BUILD_BYTES, build, is_stale
from map3d.verify.findings import Findings
from map3d.verify.rendering_checks import verify_scene

OLD = "o a\nv 0 0 0\nv 2 0 0\nv 2 3 0\nf 1 2 3\no b\nv 0 0 4\nf 1 2 4\n"
NEW = "o b\nv 0 0 0\nv 2 0 0\nv 2 3 9\nf 1 2 3\no c\nv 0 0 4\nf 1 2 4\n"
KILLED_IMPORT = """
import os, sys
from pathlib import Path
import map3d.ingest.importing as importing
from map3d.catalogue import Workspace
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.sources import find_sources
from map3d.registry import Registry

owner, name = {"parse": (importing, "_parse"), "registry": (Registry, "put_asset"), "folder": (importing, "put_in_place"),
               "catalogue": (SqliteCatalogue, "put_asset")}[sys.argv[3]]
original = getattr(owner, name)

def kill(*arguments):
    if sys.argv[4] == "after":
        original(*arguments)
    os.kill(os.getpid(), 9)

setattr(owner, name, kill)
workspace = Workspace(Path(sys.argv[1]))
importing.import_file(workspace, workspace.open_catalogue(), "town", find_sources([Path(sys.argv[2])])[0], ImportOptions(split="group"))
"""
POINTS = [(step, when) for step in ("parse", "registry", "folder", "catalogue") for when in ("before", "after")]


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    return Workspace(tmp_path / "workspace").create()


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue()
    opened.create_scene(SceneRecord("town"))
    yield opened
    opened.close()


def add(workspace: Workspace, catalogue: Catalogue, path: Path, text: str) -> None:
    path.write_text(text)
    import_file(workspace, catalogue, "town", find_sources([path])[0], ImportOptions(split="group"))


def kill_import(workspace: Workspace, path: Path, text: str, step: str, when: str) -> None:
    path.write_text(text)
    command = [sys.executable, "-c", KILLED_IMPORT, str(workspace.root), str(path), step, when]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(part for part in sys.path if part)}
    assert subprocess.run(command, check=False, env=environment, timeout=60).returncode == -signal.SIGKILL


def build_town(workspace: Workspace, catalogue: Catalogue) -> None:
    build(workspace, catalogue, "town", threads=1, max_memory_bytes=BUILD_BYTES)


def problems(workspace: Workspace, catalogue: Catalogue) -> list[str]:
    findings = Findings()
    verify_scene(workspace, catalogue, "town", findings, lambda *_: None)
    return findings.wrong


def names(workspace: Workspace) -> set[str]:
    with Registry(workspace.registry_path("town")) as registry:
        return {item.name for item in registry.objects() if item.asset == "house"}


def hidden(workspace: Workspace) -> list[str]:
    return [path.name for path in (workspace.scene_folder("town") / "assets").iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize(("step", "when"), POINTS)
def test_killed_import_is_completed_or_undone_by_the_next_build(
    workspace: Workspace, catalogue: Catalogue, tmp_path: Path, step: str, when: str
) -> None:
    add(workspace, catalogue, tmp_path / "house.obj", OLD)
    build_town(workspace, catalogue)
    kill_import(workspace, tmp_path / "house.obj", NEW, step, when)
    if step != "parse":
        assert is_stale(workspace, catalogue, "town")
        assert any("import" in line for line in problems(workspace, catalogue))
    build_town(workspace, catalogue)
    (asset,) = catalogue.assets("town")
    assert asset.digest == asset_digest(workspace.asset_folder("town", "house"))
    complete = (step, when) in (("folder", "after"), ("catalogue", "before"), ("catalogue", "after"))
    assert {"a", "b", "c"} & names(workspace) == ({"b", "c"} if complete else {"a", "b"})
    assert not is_stale(workspace, catalogue, "town")
    assert problems(workspace, catalogue) == []
    assert hidden(workspace) == []


@pytest.mark.parametrize(("step", "when"), POINTS)
def test_file_is_added_again_after_its_first_import_was_killed(
    workspace: Workspace, catalogue: Catalogue, tmp_path: Path, step: str, when: str
) -> None:
    kill_import(workspace, tmp_path / "house.obj", OLD, step, when)
    add(workspace, catalogue, tmp_path / "house.obj", NEW)
    build_town(workspace, catalogue)
    assert {"a", "b", "c"} & names(workspace) == {"b", "c"}
    assert problems(workspace, catalogue) == []
    assert hidden(workspace) == []


def test_drafts_of_running_processes_stay(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    assets = workspace.scene_folder("town") / "assets"
    drafts = [assets / f".other.{os.getpid()}.new", assets / ".other.elsewhere.00000000.1.1.new"]
    for draft in drafts:
        draft.mkdir(parents=True)
    (assets / ".other.4194304.new").mkdir()
    add(workspace, catalogue, tmp_path / "house.obj", OLD)
    assert sorted(hidden(workspace)) == sorted(draft.name for draft in drafts)


def test_verify_compares_the_folder_with_the_catalogue(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    add(workspace, catalogue, tmp_path / "house.obj", OLD)
    build_town(workspace, catalogue)
    path = workspace.asset_folder("town", "house") / "materials.json"
    path.write_text(path.read_text() + "\n")
    (line,) = problems(workspace, catalogue)
    assert "house" in line
    assert "map3d add-files" in line
