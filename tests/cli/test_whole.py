"""The command line from files to tiles."""

import hashlib
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pytest

from map3d.catalogue import State, Workspace
from map3d.registry import Registry
from map3d.tiles.manifest import Manifest
from map3d.tiles.sqlite_store import SqliteTileStore
from tests.cli.tile_ids import ids_in_tiles
from tests.cli.towns import Run, copy_original, house, make_original, write_town

pytestmark = pytest.mark.whole

VIEWS = ("--view", "0/45", "--view", "90/30")


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original")
    return make_original(
        folder,
        ("create-scene", "town"),
        ("add-files", "town", str(write_town(folder / "files"))),
        ("create-rendering", "town", "view", "--res", "0.05", *VIEWS),
    )


@pytest.fixture(scope="module")
def original_with_tiles(original: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original_with_tiles")
    copy_original(original, folder)
    return make_original(folder, ("render", "view"))


@pytest.fixture
def town(original: Path, tmp_path: Path) -> Workspace:
    """A planned rendering `view` of the scene `town`."""
    return copy_original(original, tmp_path)


@pytest.fixture
def rendered(original_with_tiles: Path, tmp_path: Path) -> Workspace:
    """The complete rendering `view` of the scene `town`."""
    return copy_original(original_with_tiles, tmp_path)


def need_viewer() -> None:
    """Skips a test that publishes while the viewer is not built."""
    from map3d.tiles.viewer_files import viewer_folder

    try:
        viewer_folder()
    except Exception as error:
        pytest.skip(f"the viewer is not built: {error}")


def digest(workspace: Workspace, rendering: str = "view") -> dict[str, str]:
    """Returns view → hash over every tile and seam."""
    found = {}
    for path in sorted(workspace.rendering_folder(rendering).glob("*.sqlite")):
        total = hashlib.sha256()
        with SqliteTileStore(path, read_only=True) as store:
            for block in store.list_blocks():
                total.update(str(block.id).encode() + (store.get_seam(block.id) or b"-"))
            for layer in range(len(store.shape.layers)):
                for tile in store.list_tiles(layer):
                    total.update(str(tile).encode() + (store.get_tile(layer, *tile) or b"-"))
        found[path.name] = total.hexdigest()
    return found


def test_files_become_tiles_that_verify(run: Run, town: Workspace) -> None:
    status, out, err = run("render", "view", "--json")
    assert status == 0, err
    result = json.loads(out)
    assert result["complete"]
    assert result["statistics"]["failed_attempts"] == 0
    manifest = Manifest.load(town.manifest_path("view").read_bytes())
    assert manifest.complete
    assert [view.frame.id for view in manifest.views] == ["0-45", "90-30"]
    assert all(view.occupancy.count(manifest.zmax) > 10 for view in manifest.views)
    status, out, err = run("verify", "--json")
    assert (status, json.loads(out)["wrong"]) == (0, []), err


def test_ids_in_tiles_are_those_of_the_registry(run: Run, rendered: Workspace) -> None:
    seen = ids_in_tiles(rendered)
    with Registry(rendered.registry_path("town")) as registry:
        known = {item.id: item.name for item in registry.objects()}
    houses = {number for number, name in known.items() if name.startswith("house")}
    assert len(houses) == 16
    assert houses <= seen
    assert seen - {0} <= set(known)


def test_second_render_does_nothing(run: Run, rendered: Workspace) -> None:
    before = (digest(rendered), rendered.manifest_path("view").read_bytes())
    status, out, _ = run("render", "view", "--json")
    assert (status, json.loads(out)["statistics"]["done"]) == (0, 0)
    assert (digest(rendered), rendered.manifest_path("view").read_bytes()) == before


def test_changed_house_renders_few_blocks_and_equals_a_full_render(run: Run, town: Workspace, tmp_path: Path) -> None:
    whole = json.loads(run("render", "view", "--json")[1])["statistics"]["done"]
    changed = tmp_path / "files" / "house-0-0.obj"
    changed.write_text(house(0.0, 0.0, 11.0))
    assert run("add-files", "town", str(changed))[0] == 0
    status, out, err = run("render", "view", "--json")
    assert status == 0, err
    result = json.loads(out)
    assert 0 < result["statistics"]["done"] < whole / 2
    assert result["content_version"] == 2
    assert run("verify")[0] == 0
    incremental = digest(town)
    assert run("create-rendering", "town", "view", "--res", "0.05", *VIEWS, "--regrid")[0] == 0
    assert run("render", "view")[0] == 0
    if digest(town) != incremental:
        pytest.fail("the incremental tiles differ from those of a full render")


def test_content_outside_the_frame_is_refused_until_regrid(run: Run, rendered: Workspace, tmp_path: Path) -> None:
    before = digest(rendered)
    far = tmp_path / "far.obj"
    far.write_text(house(600.0, 0.0, 10.0))
    run("add-files", "town", str(far))
    status, _, err = run("render", "view")
    assert (status, "--regrid" in err) == (1, True)
    assert digest(rendered) == before
    assert run("create-rendering", "town", "view", "--res", "0.5", *VIEWS, "--regrid")[0] == 0
    assert run("render", "view")[0] == 0
    assert run("verify")[0] == 0


def test_killed_render_resumes_and_ends_with_the_same_tiles(run: Run, rendered: Workspace) -> None:
    undisturbed = digest(rendered)
    for path in rendered.rendering_folder("view").iterdir():
        path.unlink()
    assert run("create-rendering", "town", "view", "--res", "0.05", *VIEWS, "--regrid")[0] == 0
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    for done in (3, 8):
        process = subprocess.Popen([sys.executable, "-m", "map3d", "render", "view"], env=environment, stderr=subprocess.DEVNULL)
        wait_for(rendered, done, process)
        process.send_signal(signal.SIGKILL)
        process.wait()
    catalogue = rendered.open_catalogue(lease_s=0.1)
    with catalogue._database.transaction() as db:  # type: ignore[attr-defined]
        db.execute("UPDATE job SET expires = expires - 3600 WHERE state = 'leased'")
    catalogue.close()
    assert run("render", "view")[0] == 0
    assert digest(rendered) == undisturbed
    assert run("verify")[0] == 0


def wait_for(town: Workspace, done: int, process: "subprocess.Popen[bytes]") -> None:
    catalogue = town.open_catalogue()
    deadline = time.monotonic() + 120
    while catalogue.count_jobs("view")[State.DONE] < done and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    catalogue.close()


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        ("UPDATE blob SET bytes = x'00' WHERE hash = (SELECT hash FROM tile WHERE layer = 0 LIMIT 1)", "hash"),
        ("DELETE FROM tile WHERE layer = 1 AND z = (SELECT max(z) FROM tile) AND x = (SELECT max(x) FROM tile)", "only one of the layers"),
        ("UPDATE block SET key = 'other' WHERE z = 0", "the catalogue says"),
        ("UPDATE block SET seam = x'4D334447' WHERE z > 0", "seam"),
        ("DELETE FROM block WHERE z = 0", "not stored"),
        ("DELETE FROM tile WHERE z = 0", "parent is missing"),
    ],
)
def test_verify_finds_changes_to_the_store(run: Run, rendered: Workspace, statement: str, says: str) -> None:
    with sqlite3.connect(rendered.store_path("view", "0-45")) as db:
        assert db.execute(statement).rowcount > 0
    db.close()
    status, out, _ = run("verify")
    assert (status, says in out) == (1, True), out


def test_verify_finds_a_broken_chunk_and_a_stale_manifest(run: Run, rendered: Workspace) -> None:
    chunk = next(rendered.scene_folder("town").glob("chunks/*.m3c"))
    data = bytearray(chunk.read_bytes())
    data[-1] ^= 1
    chunk.write_bytes(data)
    path = rendered.manifest_path("view")
    path.write_text(path.read_text().replace('"content_version": 1', '"content_version": 9'))
    status, out, _ = run("verify")
    assert status == 1
    assert "checksum" in out
    assert "content_version differs" in out


def test_verify_says_when_blocks_are_not_done(run: Run, town: Workspace) -> None:
    status, out, _ = run("verify", "view")
    assert (status, "no job" in out) == (1, True)


def test_estimate_is_close_to_the_result(run: Run, town: Workspace) -> None:
    status, out, err = run("estimate", "view", "--json", "--workers", "2")
    assert status == 0, err
    before = json.loads(out)
    assert "sample" in before["how"]
    result = json.loads(run("render", "view", "--json")[1])
    assert before["base_tiles"] == pytest.approx(result["statistics"]["base_tiles"], rel=0.35)
    assert before["bytes"] == pytest.approx(result["statistics"]["bytes"], rel=0.5)
    assert before["seconds"] > 0
    after = json.loads(run("estimate", "view", "--json")[1])
    assert after["open_tiles"] == 0
    assert "rendered blocks" in after["how"]
    assert after["base_tiles"] == result["statistics"]["base_tiles"]


def test_levels_and_layers_are_as_requested(run: Run, town: Workspace) -> None:
    asked = ("--levels", "4", "--directions", "2", "--pitch", "30", "--pitch", "90", "--layers", "id,color", "--color", "jpeg", "--tile-size", "512")
    status, out, err = run("create-rendering", "town", "other", *asked, "--json")
    assert status == 0, err
    made = json.loads(out)
    (layers,) = made["passes"]
    assert [layer["kind"] for layer in layers] == ["color", "id"]
    assert layers[0]["format"] == "jpeg"
    assert [(frame["angles"], frame["zmax"], frame["tile_px"]) for frame in made["frames"]] == [
        ([a, p], 3, 512) for a, p in ((0, 30), (180, 30), (0, 90))
    ]
    assert run("render", "other")[0] == 0
    assert run("verify", "other")[0] == 0


def test_site_refuses_a_folder_with_other_files_before_any_work(run: Run, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "letter.txt").write_text("mine")
    status, _, err = run("site", str(write_town(tmp_path / "town", 1)), "-o", str(tmp_path / "out"))
    assert (status, "is not a published rendering" in err) == (2, True), err
    assert not (tmp_path / "workspace" / "scenes").exists()
    assert (tmp_path / "out" / "letter.txt").read_text() == "mine"


def test_site_of_a_folder_processes_only_changes_when_re_run(run: Run, tmp_path: Path) -> None:
    need_viewer()
    files, out = write_town(tmp_path / "Little Town", 2), tmp_path / "site"
    status, text, err = run("site", str(files), "-o", str(out), "--res", "0.2")
    assert status == 0, err
    assert "imported 4 files" in text
    first = Manifest.load((out / "rendering.json").read_bytes())
    assert run("verify", "--published", str(out))[0] == 0
    (files / "house-0-0.obj").write_text(house(0.0, 0.0, 9.0))
    (files / "broken.obj").write_text("v 0 0 0\nv nan nan nan\nf 1 2 9\n")
    status, text, err = run("site", str(files), "-o", str(out), "--res", "0.2")
    assert (status, "published, but 1 file could not be read" in err) == (3, True), err
    assert "imported 1 file, 3 unchanged, 1 failed" in text
    assert "map3d show report" not in text
    with (files / "house-0-0.obj").open("a") as more:
        more.write("f 1 2 99\n")
    status, text, err = run("site", str(files), "-o", str(out), "--res", "0.2")
    assert "skipped 1 element; 0 warnings; map3d show report little-town lists them" in text
    assert Manifest.load((out / "rendering.json").read_bytes()).content_version != first.content_version


def test_site_with_small_tiles(run: Run, tmp_path: Path) -> None:
    need_viewer()
    town, options = write_town(tmp_path / "town", 1), ("--res", "0.1", "--view", "0-45", "--workers", "1")
    tiles_bytes = []
    for number, small in enumerate(((), ("--small",))):
        status, _, err = run("site", str(town), "-o", str(tmp_path / f"site-{number}"), *options, *small, "-w", str(tmp_path / f"work-{number}"))
        assert status == 0, err
        tiles_bytes.append(sum(path.stat().st_size for path in (tmp_path / f"site-{number}").rglob("*.pmtiles")))
    assert tiles_bytes[1] < 0.9 * tiles_bytes[0]


def test_workspace_can_be_moved(run: Run, rendered: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    moved = tmp_path / "elsewhere"
    shutil.move(rendered.root, moved)
    monkeypatch.setenv("MAP3D_WORKSPACE", str(moved))
    assert run("verify")[0] == 0
    status, out, _ = run("render", "view", "--json")
    assert (status, json.loads(out)["statistics"]["done"]) == (0, 0)
