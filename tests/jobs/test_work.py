"""`map3d work`: does the jobs that another process planned, and ends the run when that process cannot."""

import dataclasses
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import Catalogue, SceneRecord, State, Workspace
from map3d.errors import BadRequest, StoreError
from map3d.jobs import finish
from map3d.jobs.events import JobDone, PlanAwaited, RenderingLeft, RenderingSkipped, RunEvent, StoreAwaited
from map3d.jobs.open_jobs import has_jobs_left
from map3d.jobs.run import Run
from map3d.jobs.run_settings import RunSettings
from map3d.jobs.timeouts import Timeouts
from map3d.jobs.work import Work, WorkResult
from map3d.tiles.manifest import Manifest
from tests.jobs.stored import stored
from tests.renderings.scenes import SquareScene, rendering

CONTENT = {(0.05 + 0.1 * k, 0.05 + 0.1 * k): f"thing {k}" for k in range(10)}
TIMEOUTS = Timeouts(heartbeat_s=0.5, block_s=10, idle_s=0.1, tick_s=0.05, plan_s=0.1, poll_s=0.1, start_pause_s=0.01)
SETTINGS = RunSettings(2, timeouts=TIMEOUTS, entry="tests.jobs.faults:open_faulty")

PROCESS = """
import sys
from pathlib import Path
from map3d.catalogue import Workspace
from map3d.jobs.run import Run
from map3d.jobs.work import Work
from tests.jobs.test_work import CONTENT, SETTINGS
from tests.renderings.scenes import SquareScene

workspace = Workspace(Path(sys.argv[2]))
catalogue = workspace.open_catalogue(lease_s=2.0)
report = lambda event: print(type(event).__name__, flush=True)
if sys.argv[1] == "render":
    run = Run(workspace, catalogue, "r", SETTINGS)
    run.work(run.plan(scene=SquareScene(CONTENT)), report)
else:
    result = Work(workspace, catalogue, SETTINGS, forever=sys.argv[1] == "forever").run(report)
    print("ended", result.stopped, result.incomplete, flush=True)
catalogue.close()
"""


@pytest.fixture
def workspace(tmp_path: Path, faults: Path) -> Workspace:
    return make_workspace(tmp_path / "workspace")


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue(lease_s=2.0)
    yield opened
    opened.close()


def make_workspace(root: Path, *names: str, url: str | None = None) -> Workspace:
    workspace = Workspace(root, url).create()
    catalogue = workspace.open_catalogue()
    catalogue.create_scene(SceneRecord("town", "A town", origin=(0.0, 0.0, 0.0)))
    workspace.scene_folder("town").mkdir(parents=True)
    for name in names or ("r",):
        catalogue.create_rendering(dataclasses.replace(rendering(), name=name))
    catalogue.close()
    return workspace


def plan(workspace: Workspace, catalogue: Catalogue, name: str = "r", content: dict[tuple[float, float], str] = CONTENT) -> None:
    Run(workspace, catalogue, name, SETTINGS).plan(scene=SquareScene(content))


def work(workspace: Workspace, catalogue: Catalogue, *names: str) -> tuple[WorkResult, list[RunEvent]]:
    events: list[RunEvent] = []
    return Work(workspace, catalogue, SETTINGS, names).run(events.append), events


def leave_reduce_jobs_waiting(workspace: Workspace) -> int:
    """Makes all reduce jobs wait above done blocks, as a process that is killed between the two steps of `done` does. Returns their number."""
    with closing(sqlite3.connect(workspace.catalogue_path)) as db, db:
        return db.execute("UPDATE job SET state = 'waiting' WHERE kind = 'reduce'").rowcount


def start(what: str, workspace: Workspace) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    return subprocess.Popen([sys.executable, "-c", PROCESS, what, str(workspace.root)], stdout=subprocess.PIPE, text=True, env=environment)


def wait_for_line(process: subprocess.Popen[str], word: str) -> None:
    assert process.stdout is not None
    assert any(line.startswith(word) for line in process.stdout), f"the process ended without {word}"


def undisturbed(tmp_path: Path) -> tuple[bytes, dict[object, object]]:
    """Returns manifest and tiles of a run without `map3d work`."""
    other = make_workspace(tmp_path / "undisturbed")
    catalogue = other.open_catalogue()
    run = Run(other, catalogue, "r", SETTINGS)
    assert run.work(run.plan(scene=SquareScene(CONTENT)), lambda _: None).complete
    catalogue.close()
    return other.manifest_path("r").read_bytes(), stored(other)


def test_work_ends_the_run_of_a_killed_planner(workspace: Workspace, catalogue: Catalogue, faults: Path, tmp_path: Path) -> None:
    expected = undisturbed(tmp_path)
    (faults / "slow").write_text("1")
    planner = start("render", workspace)
    wait_for_line(planner, JobDone.__name__)
    helper = start("work", workspace)
    wait_for_line(helper, JobDone.__name__)
    planner.kill()
    planner.communicate()
    (faults / "slow").unlink()
    output, _ = helper.communicate(timeout=120)
    assert (helper.returncode, output.splitlines()[-1]) == (0, "ended False []")
    assert all(job.state is State.DONE and job.attempts == 1 for job in catalogue.jobs("r"))
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected


def test_planner_ends_the_run_of_a_killed_helper(workspace: Workspace, catalogue: Catalogue, faults: Path, tmp_path: Path) -> None:
    expected = undisturbed(tmp_path)
    (faults / "slow").write_text("1")
    planner = start("render", workspace)
    wait_for_line(planner, JobDone.__name__)
    helper = start("work", workspace)
    wait_for_line(helper, JobDone.__name__)
    helper.kill()
    helper.communicate()
    (faults / "slow").unlink()
    planner.communicate(timeout=120)
    assert planner.returncode == 0
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected


def test_work_writes_the_manifest_of_a_run_that_was_killed_before_it_did(workspace: Workspace, catalogue: Catalogue) -> None:
    plan(workspace, catalogue)
    announced = workspace.manifest_path("r").read_bytes()
    work(workspace, catalogue)
    complete = workspace.manifest_path("r").read_bytes()
    workspace.manifest_path("r").write_bytes(announced)
    result, events = work(workspace, catalogue, "r")
    assert (result.statistics.done, result.incomplete, events) == (0, [], [])
    assert workspace.manifest_path("r").read_bytes() == complete
    assert Manifest.load(complete).complete


def test_reduce_jobs_that_a_killed_process_left_waiting_are_done(workspace: Workspace, catalogue: Catalogue) -> None:
    plan(workspace, catalogue)
    work(workspace, catalogue)
    before = stored(workspace)
    left = leave_reduce_jobs_waiting(workspace)
    result, _ = work(workspace, catalogue)
    assert (result.statistics.done, result.incomplete) == (left, [])
    assert stored(workspace) == before


def test_jobs_that_another_process_opens_before_the_sweep_are_left(
    workspace: Workspace, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan(workspace, catalogue)
    work(workspace, catalogue)
    assert not has_jobs_left(catalogue, "r")
    leave_reduce_jobs_waiting(workspace)
    sweep = type(catalogue).sweep

    def sweep_second(self: Catalogue, rendering: str) -> int:
        assert sweep(self, rendering) > 0
        return sweep(self, rendering)

    monkeypatch.setattr(type(catalogue), "sweep", sweep_second)
    assert not catalogue.has_open_jobs("r")
    assert has_jobs_left(catalogue, "r")


@pytest.mark.parametrize("names", [(), ("r",)])
def test_rendering_with_tiles_in_another_workspace_is_not_worked_on(tmp_path: Path, faults: Path, mongo_server: str, names: tuple[str, ...]) -> None:
    url = f"{mongo_server}/work_{tmp_path.name.replace('-', '_')[-40:]}"
    here, there = make_workspace(tmp_path / "here", url=url), Workspace(tmp_path / "there", url).create()
    catalogue = here.open_catalogue()
    plan(here, catalogue)
    events: list[RunEvent] = []
    if names:
        with pytest.raises(BadRequest, match="--tiles"):
            Work(there, catalogue, SETTINGS, names).run(events.append)
    else:
        assert Work(there, catalogue, SETTINGS).run(events.append).statistics.done == 0
        assert [type(event) for event in events] == [RenderingSkipped]
    assert work(here, catalogue)[0].incomplete == []
    catalogue.close()


def test_work_without_names_does_all_renderings(tmp_path: Path, faults: Path) -> None:
    workspace = make_workspace(tmp_path / "workspace", "r", "s", "t")
    catalogue = workspace.open_catalogue()
    plan(workspace, catalogue, "r")
    plan(workspace, catalogue, "t")
    result, _ = work(workspace, catalogue)
    catalogue.close()
    assert (result.renderings, result.incomplete, result.stopped) == (["r", "t"], [], False)
    assert all(Manifest.load(workspace.manifest_path(name).read_bytes()).complete for name in ("r", "t"))


def test_work_that_waits_forever_does_what_is_planned_later(workspace: Workspace, catalogue: Catalogue) -> None:
    plan(workspace, catalogue)
    worker = Work(workspace, catalogue, SETTINGS, forever=True)
    left: list[RunEvent] = []

    def on_event(event: RunEvent) -> None:
        if isinstance(event, RenderingLeft):
            left.append(event)
            if len(left) == 1:
                plan(workspace, catalogue, content={**CONTENT, next(iter(CONTENT)): "another thing"})
            else:
                worker.stop.finish_jobs()

    result = worker.run(on_event)
    assert (len(left), result.stopped, result.incomplete) == (2, True, [])
    assert Manifest.load(workspace.manifest_path("r").read_bytes()).content_version == 2


def test_stale_plan_is_waited_for_without_losing_attempts(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    plan(workspace, catalogue)
    job = next(job for job in catalogue.jobs("r") if job.kind == "base")
    fault = faults / f"{job.block.z}-{job.block.x}-{job.block.y}"
    fault.write_text("stale")
    awaited: list[RunEvent] = []

    def on_event(event: RunEvent) -> None:
        if isinstance(event, PlanAwaited):
            awaited.append(event)
            if len(awaited) == 2:
                fault.unlink()

    result = Work(workspace, catalogue, SETTINGS).run(on_event)
    assert (len(awaited), result.incomplete, result.statistics.failed_attempts) == (2, [], 0)
    assert all(job.attempts == 1 for job in catalogue.jobs("r"))


def test_work_gives_up_when_no_subprocess_starts(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    plan(workspace, catalogue)
    (faults / "no-start").touch()
    result, _ = work(workspace, catalogue)
    assert (result.statistics.done, result.incomplete) == (0, ["r"])
    assert all(job.attempts == 0 for job in catalogue.jobs("r"))


def test_quarantined_block_leaves_an_incomplete_manifest(
    workspace: Workspace, catalogue: Catalogue, faults: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The retry raises the content version, so that the manifest of the plan is out of date and the scene is opened."""
    monkeypatch.setattr(finish, "open_scene", lambda *_: SquareScene(CONTENT))
    plan(workspace, catalogue)
    job = next(job for job in catalogue.jobs("r") if job.kind == "base")
    (faults / f"{job.block.z}-{job.block.x}-{job.block.y}").write_text("exception")
    result, _ = work(workspace, catalogue)
    assert result.incomplete == ["r"]
    assert not Manifest.load(workspace.manifest_path("r").read_bytes()).complete
    (faults / f"{job.block.z}-{job.block.x}-{job.block.y}").unlink()
    catalogue.retry("r")
    assert work(workspace, catalogue)[0].incomplete == []
    assert Manifest.load(workspace.manifest_path("r").read_bytes()).complete


@pytest.mark.parametrize("signals", [1, 2])
def test_work_drains_on_sigterm(workspace: Workspace, catalogue: Catalogue, faults: Path, signals: int) -> None:
    """One signal finishes the current blocks, a second one releases them."""
    (faults / "slow").write_text("0.5" if signals == 1 else "8")
    plan(workspace, catalogue)
    process = start("forever", workspace)
    wait_for_line(process, "RenderingStarted")
    while len(list(catalogue.jobs("r", state=State.LEASED))) < 2:
        time.sleep(0.01)
    leased = {(job.track, job.block) for job in catalogue.jobs("r", state=State.LEASED)}
    for _ in range(signals):
        process.send_signal(signal.SIGTERM)
        wait_for_line(process, "Stopping")
    output, _ = process.communicate(timeout=60)
    assert (process.returncode, output.splitlines()[-1]) == (0, "ended True []")
    after = {(job.track, job.block): job for job in catalogue.jobs("r")}
    assert catalogue.count_jobs("r")[State.LEASED] == 0
    assert {after[place].state for place in leased} == {State.DONE if signals == 1 else State.TODO}
    assert {after[place].attempts for place in leased} == {2 - signals}


def test_idle_work_that_waits_forever_ends_on_a_signal(workspace: Workspace, catalogue: Catalogue) -> None:
    plan(workspace, catalogue)
    process = start("forever", workspace)
    wait_for_line(process, "RenderingLeft")
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=30)
    assert (process.returncode, output.splitlines()[-1]) == (0, "ended True []")


def test_database_that_is_away_is_waited_for(workspace: Workspace, catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    plan(workspace, catalogue)
    has_open_jobs, calls = type(catalogue).has_open_jobs, []

    def away_at_first(self: Catalogue, rendering: str) -> bool:
        calls.append(rendering)
        if len(calls) <= 2:
            raise StoreError("the database is away")
        return bool(has_open_jobs(self, rendering))

    monkeypatch.setattr(type(catalogue), "has_open_jobs", away_at_first)
    events: list[RunEvent] = []
    settings = dataclasses.replace(SETTINGS, timeouts=dataclasses.replace(TIMEOUTS, longest_pause_s=0.1))
    worker = Work(workspace, catalogue, settings, forever=True)

    def on_event(event: RunEvent) -> None:
        events.append(event)
        if isinstance(event, RenderingLeft):
            worker.stop.finish_jobs()

    worker.run(on_event)
    assert [event for event in events if isinstance(event, StoreAwaited)] == [StoreAwaited("the database is away")] * 2
    assert RenderingLeft("r", True) in events
    calls.clear()
    with pytest.raises(StoreError, match="away"):
        Work(workspace, catalogue, SETTINGS).run(events.append)
