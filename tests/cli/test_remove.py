"""Removing files, renderings and scenes: everything that is theirs goes, everything else stays, and a kill at any point is healed by repeating."""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.object_store import open_object_store
from map3d.registry import Registry
from tests.cli.test_incremental import keys, render_from_scratch
from tests.cli.test_whole import digest
from tests.cli.towns import Run, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `files` and a workspace in which `town` has the complete renderings `view` and `other`, and `village` none."""
    from map3d.cli import app

    folder = tmp_path_factory.mktemp("finished")
    where = ("-w", str(folder / "workspace"))
    files = write_town(folder / "files", 3)
    (files / "ground.obj").write_text("v -60 -60 -1\nv 150 -60 -1\nv 150 150 -1\nv -60 150 -1\nf 1 2 3 4\n")
    for command in (
        ["create-scene", "town"],
        ["add-files", "town", str(files)],
        ["create-rendering", "town", "view", "--res", "0.05", "--view", "0/45"],
        ["create-rendering", "town", "other", "--res", "1", "--view", "90/45"],
        ["render", "view", "--workers", "1"],
        ["render", "other", "--workers", "1"],
        ["create-scene", "village"],
        ["add-files", "village", str(files / "house-0-0.obj")],
    ):
        assert app.run([*command, *where]) == 0
    return folder


@pytest.fixture
def town(finished: Path, tmp_path: Path) -> Iterator[Workspace]:
    shutil.copytree(finished, tmp_path, dirs_exist_ok=True)
    return Workspace(tmp_path / "workspace")


def ids(workspace: Workspace) -> dict[tuple[str, str], int]:
    with Registry(workspace.registry_path("town")) as registry:
        return {(item.asset, item.name): item.id for item in registry.objects()}


def files_below(folder: Path) -> dict[str, int]:
    return {str(path.relative_to(folder)): path.stat().st_size for path in folder.rglob("*") if path.is_file()}


def lease(workspace: Workspace, rendering: str, worker: str) -> None:
    catalogue = workspace.open_catalogue()
    place = next(iter(catalogue.jobs(rendering)))
    catalogue.reopen(rendering, [(place.track, place.block)])
    assert catalogue.lease(rendering, worker) is not None
    catalogue.close()


# -- files ----------------------------------------------------------------------------------------------------------------------------


def test_removed_file_leaves_and_only_its_blocks_are_rendered_again(run: Run, town: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    before, known = keys(town), ids(town)
    status, out, err = run("remove-files", "town", "house-1-1", "--yes")
    assert (status, "removed 1 file from town" in out) == (0, True), err
    assert not town.asset_folder("town", "house-1-1").exists()
    assert ids(town) == {place: number for place, number in known.items() if place[0] != "house-1-1"}
    assert run("render", "view")[0] == 0
    changed = {place for place, key in keys(town).items() if before.get(place) != key}
    assert changed
    assert len(changed) < len(before)
    assert run("verify", "view")[0] == 0
    assert digest(town) == render_from_scratch(run, town, monkeypatch)


def test_removing_frees_the_built_files_that_nothing_else_uses(run: Run, town: Workspace) -> None:
    folder = town.scene_folder("town")
    names = [f"house-{i}-{j}" for i in range(3) for j in range(3)]
    before = sum(files_below(folder).values())
    status, out, _ = run("remove-files", "town", *names, "--yes", "--json")
    assert status == 0
    assert sum(files_below(folder).values()) < before
    assert f'"bytes": {before - sum(files_below(folder).values())}' in out
    assert not list((folder / "build").glob("house-*"))
    assert run("remove-files", "town", "ground", "--yes")[0] == 0
    assert set(files_below(folder)) == {".lock", "registry.sqlite", "removed-assets.json"}
    for command in (["show"], ["show", "scene", "town"], ["show", "rendering", "view"]):
        assert run(*command)[0] == 0


def test_file_that_returns_gets_its_ids_back_and_its_tiles_are_the_same(run: Run, town: Workspace, tmp_path: Path) -> None:
    known, tiles = ids(town), digest(town)
    assert run("remove-files", "town", "house-0-1.obj", "--yes")[0] == 0
    assert run("render", "view")[0] == 0
    assert digest(town) != tiles
    stranger = tmp_path / "stranger.obj"
    stranger.write_text("o hut\nv 200 0 0\nv 202 0 0\nv 202 3 9\nf 1 2 3\n")
    assert run("add-files", "town", str(stranger))[0] == 0
    assert not set(known.values()) & {number for place, number in ids(town).items() if place[0] == "stranger"}
    assert run("remove-files", "town", "stranger", "--yes")[0] == 0
    assert run("add-files", "town", str(tmp_path / "files" / "house-0-1.obj"))[0] == 0
    assert ids(town) == known
    assert run("render", "view")[0] == 0
    assert digest(town) == tiles


def test_unknown_files_are_refused_before_anything_is_removed(run: Run, town: Workspace) -> None:
    before = ids(town)
    status, _, err = run("remove-files", "town", "house-0-0", "castle", "--yes")
    assert status == 2
    assert "no asset and no file 'castle'; its assets: ground, house-0-0" in err
    assert ids(town) == before
    assert run("remove-files", "atlantis", "castle", "--yes")[0] == 2


# -- confirmation ---------------------------------------------------------------------------------------------------------------------

REMOVALS = (("remove-files", "town", "house-0-0"), ("remove-rendering", "view"), ("remove-scene", "town", "--with-renderings"))


class Terminal:
    """Standard input that a person types at."""

    def __init__(self, typed: str) -> None:
        self._typed = typed

    def isatty(self) -> bool:
        return True

    def readline(self, *_: int) -> str:
        return self._typed


@pytest.mark.parametrize("command", REMOVALS)
def test_removing_needs_a_confirmation(run: Run, town: Workspace, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]) -> None:
    before = files_below(town.root / "scenes") | files_below(town.root / "renderings")
    status, _, err = run(*command)
    assert (status, "run the command again with --yes" in err) == (2, True)
    monkeypatch.setattr("sys.stdin", Terminal("n\n"))
    status, _, err = run(*command)
    assert (status, "nothing was removed" in err) == (1, True)
    assert before.items() <= (files_below(town.root / "scenes") | files_below(town.root / "renderings")).items()
    monkeypatch.setattr("sys.stdin", Terminal("y\n"))
    assert run(*command)[0] == 0


# -- renderings and scenes ------------------------------------------------------------------------------------------------------------


def test_removed_rendering_leaves_nothing_and_the_other_stays(run: Run, town: Workspace) -> None:
    size = sum(files_below(town.rendering_folder("view")).values())
    other = files_below(town.rendering_folder("other"))
    status, out, _ = run("remove-rendering", "view", "--yes", "--json")
    assert (status, f'"bytes": {size}' in out) == (0, True)
    assert os.listdir(town.root / "renderings") == ["other"]
    assert files_below(town.rendering_folder("other")) == other
    assert run("verify")[0] == 0
    assert run("remove-rendering", "view", "--yes")[0] == 2
    assert run("create-rendering", "town", "view", "--res", "1", "--view", "0/45")[0] == 0
    assert run("render", "view")[0] == 0
    assert run("verify")[0] == 0


@pytest.mark.parametrize("command", [("remove-rendering", "view"), ("remove-scene", "town", "--with-renderings")])
def test_published_folders_stay_and_are_named(run: Run, town: Workspace, command: tuple[str, ...]) -> None:
    for folder in (town.root / "published" / "shown", town.root.parent / "elsewhere"):
        status, _, err = run("publish", "view", "--out", str(folder))
        assert status == 0, err
    before = files_below(town.root / "published")
    status, out, err = run(*command, "--yes")
    assert (status, f"published files of view stay in {town.root / 'published' / 'shown'}, " in out) == (0, True), err
    assert out.count("published files") == 1
    assert files_below(town.root / "published") == before


def test_published_folders_that_stay_are_in_the_json(run: Run, town: Workspace) -> None:
    assert run("publish", "view", "--out", str(town.root / "published" / "shown"))[0] == 0
    assert json.loads(run("remove-rendering", "other", "--yes", "--json")[1])["published"] == []
    assert json.loads(run("remove-rendering", "view", "--yes", "--json")[1])["published"] == ["shown"]


@pytest.mark.parametrize("kind", ["folder", "s3"])
def test_tiles_in_an_object_store_go_too(run: Run, town: Workspace, tmp_path: Path, request: pytest.FixtureRequest, kind: str) -> None:
    from map3d.web.server.asgi_app import create_app
    from tests.web.conftest import Client

    url = (tmp_path / "tiles").as_uri() if kind == "folder" else request.getfixturevalue("s3_url")
    open_object_store(url).put("near/rendering.json", b"12345")
    assert run("create-rendering", "town", "far", "--res", "1", "--view", "0/45", "--tiles", url)[0] == 0
    assert run("render", "far")[0] == 0
    size = sum(size for name, size in open_object_store(url).list() if name.startswith("far/"))
    client = Client(create_app(town.root))
    addresses = ["/tiles/far/rendering.json", "/tiles/far/0-45/color/0/0/0"]
    assert [client.get(address).status_code for address in addresses] == [200, 200]
    local = sum(files_below(town.rendering_folder("far")).values())
    status, out, err = run("remove-rendering", "far", "--yes", "--json")
    assert (status, f'"bytes": {size + local}' in out) == (0, True), err
    assert list(open_object_store(url).list()) == [("near/rendering.json", 5)]
    assert not (tmp_path / "tiles" / "far").exists()
    while client.get(addresses[1]).status_code != 404:  # the server looks for a changed store once a second
        pass
    assert client.get(addresses[0]).status_code == 404
    client.close()


def test_scene_with_renderings_is_refused_naming_them(run: Run, town: Workspace) -> None:
    status, _, err = run("remove-scene", "town", "--yes")
    assert (status, "has renderings (other, view)" in err) == (2, True)
    assert run("verify")[0] == 0
    assert run("remove-scene", "town", "--yes", "--with-renderings")[0] == 0
    assert os.listdir(town.root / "scenes") == ["village"]
    assert os.listdir(town.root / "renderings") == []
    assert run("remove-scene", "village", "--yes")[0] == 0
    status, out, _ = run("show", "scenes", "--json")
    assert (status, out.strip()) == (0, "[]")


def test_open_server_answers_404_for_what_was_removed(run: Run, town: Workspace) -> None:
    from map3d.web.server.asgi_app import create_app
    from tests.web.conftest import Client

    client = Client(create_app(town.root))
    addresses = ["/tiles/view/rendering.json", "/tiles/view/0-45/color/0/0/0", "/tiles/view/objects/search.json", "/view/view/"]
    assert [client.get(address).status_code for address in addresses[:3]] == [200, 200, 200]
    assert run("remove-rendering", "view", "--yes")[0] == 0
    while client.get(addresses[1]).status_code != 404:  # the server looks for a changed store once a second
        pass
    assert [client.get(address).status_code for address in addresses] == [404] * 4
    assert run("remove-scene", "town", "--yes", "--with-renderings")[0] == 0
    assert client.get("/renderings").status_code == 200
    assert client.get("/tiles/other/objects/0.json").status_code == 404
    client.close()


# -- what is in use -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", REMOVALS)
def test_what_is_being_rendered_is_not_removed(run: Run, town: Workspace, command: tuple[str, ...]) -> None:
    lease(town, "view", "elsewhere.00000000.17.1.1")
    status, _, err = run(*command, "--yes")
    assert status == 2
    assert "rendering view: 1 workers are rendering it (elsewhere.00000000.17.1.1)" in err


def test_lease_of_a_dead_worker_of_this_host_does_not_count(run: Run, town: Workspace) -> None:
    from map3d.process_identity import ProcessIdentity

    lease(town, "view", f"{replace(ProcessIdentity.current(), pid=4194304)}.1")
    assert run("remove-rendering", "view", "--yes")[0] == 0


@pytest.mark.parametrize("command", [REMOVALS[0], REMOVALS[2]])
def test_scene_that_another_process_changes_is_not_removed(run: Run, town: Workspace, command: tuple[str, ...]) -> None:
    with scene_lock(town, "town"):
        status, _, err = run(*command, "--yes")
    assert status == 2
    assert "scene town: another process is building it" in err
    assert run("verify")[0] == 0


def test_scene_with_a_running_import_is_not_removed(run: Run, town: Workspace) -> None:
    (town.scene_folder("village") / "assets" / ".castle.elsewhere.00000000.1.1.new").mkdir()
    status, _, err = run("remove-scene", "village", "--yes")
    assert (status, "castle is being imported" in err) == (2, True)


# -- kills ----------------------------------------------------------------------------------------------------------------------------

KILLED = """
import os, sys
from map3d.cli import app
import map3d.ingest.asset_removal as asset_removal, map3d.lifecycle.remove_rendering as rendering, map3d.lifecycle.remove_scene as scene
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.object_store import open_object_store
from map3d.registry import Registry

owners = {"asset_removal": asset_removal, "rendering": rendering, "scene": scene, "catalogue": SqliteCatalogue, "registry": Registry}
owner, name, when, *command = sys.argv[1:]
original = getattr(owners[owner], name)

def kill(*arguments):
    if when == "after":
        original(*arguments)
    os.kill(os.getpid(), 9)

setattr(owners[owner], name, kill)
app.run(command)
"""
POINTS = [
    ("remove-files", "catalogue", "remove_asset"),
    ("remove-files", "asset_removal", "remove_folder"),
    ("remove-files", "registry", "remove_assets"),
    ("remove-rendering", "catalogue", "remove_rendering"),
    ("remove-rendering", "rendering", "remove_folder"),
    ("remove-scene", "catalogue", "remove_rendering"),
    ("remove-scene", "rendering", "remove_folder"),
    ("remove-scene", "catalogue", "remove_scene"),
    ("remove-scene", "scene", "remove_folder"),
]


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize(("verb", "owner", "function"), POINTS)
def test_killed_removal_is_completed_by_repeating_it(
    run: Run, town: Workspace, tmp_path: Path, verb: str, owner: str, function: str, when: str
) -> None:
    command = next(command for command in REMOVALS if command[0] == verb)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(part for part in sys.path if part)}
    arguments = [sys.executable, "-c", KILLED, owner, function, when, *command, "--yes"]
    assert subprocess.run(arguments, check=False, env=environment, timeout=120).returncode == -signal.SIGKILL
    for harmless in (["show", "scenes"], ["show", "renderings"]):
        assert run(*harmless)[0] == 0
    status, _, err = run("verify")
    assert status in (0, 1)
    assert all("removal" in line or "checked" in line or "problem" in line or "files have changed" in line for line in err.splitlines()), err
    assert run(*command, "--yes")[0] == 0
    assert not [path for path in town.root.rglob("*") if path.name.startswith(".") and path.name != ".lock"]
    if verb == "remove-files":
        assert not town.asset_folder("town", "house-0-0").exists()
        assert ("house-0-0", "house-0-0") not in ids(town)
        assert run("render", "view")[0] == 0
        assert run("render", "other")[0] == 0
    else:
        assert not town.rendering_folder("view").exists()
        assert town.scene_folder("town").exists() == (verb == "remove-rendering")
    assert run("verify")[0] == 0


@pytest.mark.parametrize(("verb", "owner", "function"), [POINTS[4], POINTS[8]])
def test_name_of_a_killed_removal_can_be_used_again(run: Run, town: Workspace, tmp_path: Path, verb: str, owner: str, function: str) -> None:
    command = next(command for command in REMOVALS if command[0] == verb)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(part for part in sys.path if part)}
    arguments = [sys.executable, "-c", KILLED, owner, function, "before", *command, "--yes"]
    assert subprocess.run(arguments, check=False, env=environment, timeout=120).returncode == -signal.SIGKILL
    if verb == "remove-scene":
        assert run("create-scene", "town")[0] == 0
        assert run("add-files", "town", str(tmp_path / "files" / "house-0-0.obj"))[0] == 0
        assert len(ids(town)) == 1
    assert run("create-rendering", "town", "view", "--res", "1", "--view", "0/45")[0] == 0
    assert run("render", "view")[0] == 0
    assert run("verify")[0] == 0
