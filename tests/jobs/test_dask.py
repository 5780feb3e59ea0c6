"""A render on a Dask cluster of processes on this machine: lost workers and adaptive scaling change neither tiles nor manifest."""

import os
import signal
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
from map3d.catalogue import Catalogue, State, Workspace
from map3d.errors import BadRequest
from map3d.jobs.dask.pool import DaskPools
from map3d.jobs.events import JobDone, Planned, RunEvent, WorkerExited
from map3d.jobs.run import Run, RunResult
from map3d.jobs.run_settings import RunSettings
from tests.jobs.stored import stored
from tests.jobs.test_work import CONTENT, TIMEOUTS, leave_reduce_jobs_waiting, make_workspace, undisturbed, work
from tests.renderings.scenes import SquareScene

dask = pytest.importorskip("dask", reason="install map3d[dask]")
distributed = pytest.importorskip("distributed", reason="install map3d[dask]")

SETTINGS = RunSettings(1, timeouts=replace(TIMEOUTS, block_s=60, wait_s=60), entry="tests.jobs.faults:open_faulty")


@pytest.fixture
def workspace(tmp_path: Path, faults: Path, request: pytest.FixtureRequest) -> Workspace:
    """With an SQLite catalogue; with the parameter "mongodb", with one in MongoDB."""
    is_mongodb = getattr(request, "param", None) == "mongodb"
    url = f"{request.getfixturevalue('mongo_server')}/dask_{os.getpid()}_{time.monotonic_ns()}" if is_mongodb else None
    return make_workspace(tmp_path / "workspace", url=url)


@pytest.fixture
def catalogue(workspace: Workspace) -> Iterator[Catalogue]:
    opened = workspace.open_catalogue(lease_s=5.0)
    yield opened
    opened.close()


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """Its scheduler blames a task at the first worker that it loses."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        tempfile.TemporaryDirectory() as scratch,
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", local_directory=scratch
        ) as local,
    ):
        yield local


@contextmanager
def dask_pools(local: Any, workspace: Workspace, catalogue: Catalogue) -> Iterator[DaskPools]:
    with DaskPools(local.scheduler_address, workspace, catalogue, SETTINGS) as pools:
        yield pools


def render(workspace: Workspace, catalogue: Catalogue, pools: DaskPools, on_event: Any = lambda _: None) -> RunResult:
    run = Run(workspace, catalogue, "r", SETTINGS, pools)
    return run.work(run.plan(scene=SquareScene(CONTENT)), on_event)


def processes(events: list[RunEvent]) -> set[int]:
    """Returns the ids of the processes that did jobs."""
    return {int(event.lease.worker.rsplit(".", 3)[1]) for event in events if isinstance(event, JobDone)}


@pytest.mark.parametrize("workspace", ["sqlite", pytest.param("mongodb", marks=pytest.mark.third_party)], indirect=True)
def test_killed_dask_worker_changes_nothing(workspace: Workspace, catalogue: Catalogue, faults: Path, tmp_path: Path) -> None:
    """A worker is killed while it renders, and Dask does not run its task again."""
    expected = undisturbed(tmp_path)
    (faults / "slow").write_text("1")
    events: list[RunEvent] = []
    killed: list[int] = []

    def on_event(event: RunEvent) -> None:
        events.append(event)
        if len(processes(events)) == 2 and not killed:
            leased = [job for job in catalogue.jobs("r", state=State.LEASED) if job.worker is not None]
            if leased:
                killed.append(int(str(leased[0].worker).rsplit(".", 3)[1]))
                os.kill(killed[0], signal.SIGKILL)
                (faults / "slow").unlink()

    with cluster(2) as local, dask_pools(local, workspace, catalogue) as pools:
        result = render(workspace, catalogue, pools, on_event)
    assert killed
    assert (result.complete, result.statistics.failed_attempts) == (True, 0)
    jobs = list(catalogue.jobs("r"))
    assert sum(job.expiries for job in jobs) <= 1
    assert all(job.attempts == 1 for job in jobs)
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected


def test_reduce_jobs_that_a_killed_process_left_waiting_are_done(workspace: Workspace, catalogue: Catalogue, tmp_path: Path) -> None:
    """Another process does the jobs, and is killed before it opens the ones above."""
    expected = undisturbed(tmp_path)

    def on_event(event: RunEvent) -> None:
        if isinstance(event, Planned):
            work(workspace, catalogue)
            leave_reduce_jobs_waiting(workspace)

    with cluster(1) as local, dask_pools(local, workspace, catalogue) as pools:
        result = render(workspace, catalogue, pools, on_event)
    assert (result.complete, result.statistics.done) == (True, len([job for job in catalogue.jobs("r") if job.kind == "reduce"]))
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected


@pytest.mark.third_party
def test_adaptive_cluster_grows_and_its_new_worker_takes_part(workspace: Workspace, catalogue: Catalogue, faults: Path, tmp_path: Path) -> None:
    expected = undisturbed(tmp_path)
    (faults / "slow").write_text("1")
    events: list[RunEvent] = []

    def on_event(event: RunEvent) -> None:
        events.append(event)
        if len(processes(events)) == 2 and (faults / "slow").exists():
            (faults / "slow").unlink()

    with cluster(1) as local:
        local.adapt(minimum=1, maximum=2, interval="100ms", target_duration="1s", wait_count=100)
        with dask_pools(local, workspace, catalogue) as pools:
            result = render(workspace, catalogue, pools, on_event)
    assert result.complete
    assert len(processes(events)) == 2
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected


@pytest.mark.third_party
def test_faulty_block_is_quarantined_and_a_resident_subprocess_does_the_others(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    (faults / "log").touch()
    with cluster(1) as local, dask_pools(local, workspace, catalogue) as pools:
        run = Run(workspace, catalogue, "r", SETTINGS, pools)
        plan = run.plan(scene=SquareScene(CONTENT))
        block = next(job.block for job in catalogue.jobs("r") if job.kind == "base")
        (faults / f"{block.z}-{block.x}-{block.y}").write_text("segfault")
        result = run.work(plan, lambda _: None)
        assert not result.complete
        assert {job.block for job in catalogue.jobs("r", state=State.QUARANTINED)} == {block}
        (faults / f"{block.z}-{block.x}-{block.y}").unlink()
        catalogue.retry("r")
        (faults / "log").write_text("")
        assert render(workspace, catalogue, pools).complete
        assert len(set((faults / "log").read_text().split())) == 1, "one subprocess does all jobs of a Dask worker"


@pytest.mark.third_party
def test_stop_finishes_current_blocks_and_ends_the_subprocesses(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    (faults / "slow").write_text("0.2")
    (faults / "log").touch()
    with cluster(1) as local:
        with dask_pools(local, workspace, catalogue) as pools:
            run = Run(workspace, catalogue, "r", SETTINGS, pools)
            result = run.work(run.plan(scene=SquareScene(CONTENT)), lambda event: run.stop.finish_jobs() if isinstance(event, JobDone) else None)
            assert result.stopped
            assert 1 <= result.statistics.done <= 3
            counts = catalogue.count_jobs("r")
            assert (counts[State.LEASED], counts[State.QUARANTINED]) == (0, 0)
        (subprocess,) = set((faults / "log").read_text().split())
        deadline = time.monotonic() + 20
        while Path(f"/proc/{subprocess}").exists():
            assert time.monotonic() < deadline
            time.sleep(0.05)


@pytest.mark.third_party
def test_second_stop_releases_the_blocks(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    (faults / "slow").write_text("50")
    (faults / "log").touch()
    with cluster(1) as local, dask_pools(local, workspace, catalogue) as pools:
        run = Run(workspace, catalogue, "r", SETTINGS, pools)

        def on_event(_event: RunEvent) -> None:
            if catalogue.count_jobs("r")[State.LEASED]:
                run.stop.release_jobs()

        started = time.monotonic()
        result = run.work(run.plan(scene=SquareScene(CONTENT)), on_event)
        assert time.monotonic() - started < 40
        assert (result.stopped, result.statistics.done, catalogue.count_jobs("r")[State.LEASED]) == (True, 0, 0)
        assert all(job.attempts == 0 for job in catalogue.jobs("r"))


def test_cluster_that_cannot_work_ends_the_run_with_the_reason(workspace: Workspace, catalogue: Catalogue, faults: Path) -> None:
    (faults / "no-start").touch()
    events: list[RunEvent] = []
    with cluster(1) as local, dask_pools(local, workspace, catalogue) as pools:
        result = render(workspace, catalogue, pools, events.append)
    assert not result.complete
    assert result.open_jobs == len(list(catalogue.jobs("r")))
    (reason,) = [event.reason for event in events if isinstance(event, WorkerExited)]
    assert "cannot start" in str(reason)
    assert all(job.attempts == 0 for job in catalogue.jobs("r"))


def test_missing_scheduler_is_reported(workspace: Workspace, catalogue: Catalogue) -> None:
    with pytest.raises(BadRequest, match="tcp://HOST:8786"):
        DaskPools("nonsense://127.0.0.1", workspace, catalogue, SETTINGS)
