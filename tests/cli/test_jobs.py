"""`map3d jobs` and `map3d work` on a small town."""

import json
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from map3d.catalogue import State, Workspace
from map3d.messages import verbatim
from map3d.tiles.naming import block_levels
from tests.cli.test_verify_pixels import swap_two_images
from tests.cli.test_whole import digest
from tests.cli.towns import Run, copy_original, make_original, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

TRACK = "0-45"


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("original")
    return make_original(
        folder,
        ("create-scene", "town"),
        ("add-files", "town", str(write_town(folder / "files", 3))),
        ("create-rendering", "town", "view", "--res", "0.05", "--view", "0/45"),
        ("render", "view"),
    )


@pytest.fixture
def rendered(original: Path, tmp_path: Path) -> Workspace:
    """The complete rendering `view` of the scene `town`."""
    return copy_original(original, tmp_path)


def base_block(workspace: Workspace, number: int = 0) -> str:
    """Returns a base block with tiles."""
    catalogue = workspace.open_catalogue()
    jobs = [job for job in catalogue.jobs("view", TRACK) if job.kind == "base" and job.result is not None and job.result.tiles]
    catalogue.close()
    return str(jobs[number].block)


def change_store(workspace: Workspace, *statements: str) -> None:
    with closing(sqlite3.connect(workspace.store_path("view", TRACK))) as db, db:
        for statement in statements:
            assert db.execute(statement).rowcount > 0, statement


def repair_and_render(run: Run, workspace: Workspace, *options: str) -> tuple[str, int]:
    """Returns what repair printed, and how many blocks the render did; afterwards everything is as before the damage."""
    status, out, err = run("jobs", "repair", "view", *options)
    assert status == 0, err
    status, rendered, err = run("render", "view", "--json")
    assert status == 0, err
    status, found, _ = run("verify", "view", "--deep")
    assert status == 0, found
    return out, json.loads(rendered)["statistics"]["done"]


def test_repair_of_a_sound_rendering_opens_nothing(run: Run, rendered: Workspace) -> None:
    out, done = repair_and_render(run, rendered, "--deep")
    assert ("no problems found" in out, done) == (True, 0)


@pytest.mark.parametrize("damage", ["bytes", "missing", "key", "seam", "file", "pixels"])
def test_repair_heals_damaged_blocks(run: Run, rendered: Workspace, damage: str) -> None:
    before = digest(rendered)
    block, tiles = base_block(rendered), f"FROM tile WHERE block = '{base_block(rendered)}'"
    if damage == "bytes":
        changed = "CAST(substr(bytes, 1, 40) || x'00ff' || substr(bytes, 43) AS BLOB)"
        change_store(rendered, f"UPDATE blob SET bytes = {changed} WHERE hash IN (SELECT hash {tiles} LIMIT 1)")
    elif damage == "missing":
        change_store(rendered, f"DELETE {tiles}", f"DELETE FROM block WHERE id = '{block}'")
    elif damage == "key":
        change_store(rendered, f"UPDATE block SET key = 'another' WHERE id = '{block}'")
    elif damage == "seam":
        change_store(rendered, f"UPDATE block SET seam = substr(seam, 1, 30) WHERE id = '{block}'")
    elif damage == "file":
        rendered.store_path("view", TRACK).unlink()
    else:
        swap_two_images(rendered.store_path("view", TRACK))
    assert damage == "pixels" or run("verify", "view")[0] == 1
    out, done = repair_and_render(run, rendered, *(["--deep"] if damage == "pixels" else []))
    levels = len(block_levels(rendered.open_catalogue().rendering("view").zmax))
    assert damage == "file" or done >= levels
    assert "opened again" in out
    assert digest(rendered) == before


def test_jobs_shows_all_renderings_and_one(run: Run, rendered: Workspace) -> None:
    status, out, _ = run("jobs")
    assert (status, "view" in out, "100 %" in out) == (0, True, True)
    status, out, _ = run("jobs", "view")
    assert (status, TRACK in out, "base" in out, "no workers" in out) == (0, True, True, True)
    assert run("jobs", "show", "view")[1] == out
    report = json.loads(run("jobs", "view", "--json")[1])
    assert (report["complete"], report["open_jobs"], report["leases"], report["failing"]) == (True, 0, [], [])
    assert sum(level["counts"]["done"] for level in report["levels"]) == report["counts"]["done"]
    assert report["bytes"] > 0
    assert run("jobs", "nothing")[0] == 2
    assert run("jobs", "--help")[0] == 0


def test_watch_in_a_pipe_prints_one_line_per_refresh(run: Run, rendered: Workspace) -> None:
    status, out, _ = run("jobs", "view", "--watch", "--every", "0.1")
    assert (status, len(out.splitlines())) == (0, 1)
    assert out.startswith("view: 100 %")
    status, out, _ = run("jobs", "--watch", "--json")
    assert json.loads(out)[0]["rendering"] == "view"


def test_jobs_shows_leases_with_host_and_time(run: Run, rendered: Workspace) -> None:
    catalogue = rendered.open_catalogue()
    (z, x, y) = (int(part) for part in base_block(rendered).split("/"))
    catalogue.reopen("view", [(TRACK, type(next(iter(catalogue.jobs("view"))).block)(z, x, y))])
    lease = catalogue.lease("view", "node-7.0123abcd.42.99.1")
    assert lease is not None
    (held,) = json.loads(run("jobs", "view", "--json")[1])["leases"]
    assert (held["host"], held["block"], held["attempt"], 0 <= held["seconds"] < 60) == ("node-7", list(lease.block), 1, True)
    assert "node-7" in run("jobs", "view")[1]
    catalogue.fail(lease, verbatim("the sky fell"))
    assert "the sky fell" in run("jobs", "view")[1]
    catalogue.close()


def test_cancelled_blocks_are_retried_or_rendered(run: Run, rendered: Workspace) -> None:
    catalogue = rendered.open_catalogue()
    catalogue.reopen("view", [(job.track, job.block) for job in catalogue.jobs("view")])
    assert "cancelled" in run("jobs", "cancel", "view")[1]
    assert catalogue.count_jobs("view")[State.CANCELLED] == len(list(catalogue.jobs("view")))
    assert not catalogue.has_open_jobs("view")
    assert run("jobs", "retry", "view")[0] == 0
    assert catalogue.has_open_jobs("view")
    catalogue.close()
    assert run("work", "view", "--workers", "1")[0] == 0
    assert run("verify", "view")[0] == 0


def test_reproduce_renders_a_block_and_stores_nothing(run: Run, rendered: Workspace) -> None:
    block = base_block(rendered)
    before = rendered.store_path("view", TRACK).read_bytes()
    status, out, err = run("jobs", "reproduce", "view", block)
    assert (status, "done after" in out, "memory" in out, "images" in out) == (0, True, True, True), err
    found = json.loads(run("jobs", "reproduce", "view", block, "--json", "--track", TRACK)[1])
    assert (found[0]["outcome"], found[0]["signal"], found[0]["peak_bytes"] > 1 << 20) == ("done", None, True)
    assert rendered.store_path("view", TRACK).read_bytes() == before
    assert run("jobs", "reproduce", "view", "0/0/9")[0] == 2
    assert run("jobs", "reproduce", "view", "nonsense")[0] == 2
    assert run("jobs", "reproduce", "view", block, "--track", "1-1")[0] == 2


def test_work_renders_what_another_process_planned(run: Run, rendered: Workspace, tmp_path: Path) -> None:
    before = digest(rendered)
    catalogue = rendered.open_catalogue()
    catalogue.reopen("view", [(job.track, job.block) for job in catalogue.jobs("view")])
    catalogue.close()
    shutil.rmtree(rendered.rendering_folder("view"))
    status, out, err = run("work", "--workers", "2", "--json")
    assert status == 0, err
    assert json.loads(out)["renderings"] == ["view"]
    assert digest(rendered) == before
    assert run("verify", "view", "--deep")[0] == 0
    assert run("work", "nothing")[0] == 2
