"""A real pool with real faults: subprocesses die in every possible way, and only the faulty blocks fail."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.catalogue import JobResult, Lease, State
from map3d.catalogue.workspace import CATALOGUE_VARIABLE
from map3d.errors import StoreError
from map3d.jobs.events import JobDone, Remaining, RunEvent, Stopping, Waiting, WorkerExited
from map3d.jobs.timeouts import Timeouts
from map3d.renderings.render_task import RenderTask
from map3d.subprocess import Message
from map3d.tiles.sqlite_store import SqliteTileStore
from tests.jobs.town import BLOCKS, LEASE_S, TIMEOUTS, VIEW, Town, make_town, open_town, planned_jobs

JOBS = BLOCKS * BLOCKS
FAULTS = ["segfault", "abort", "killed", "hang", "spin", "exception", "exit 0", "memory", "stack overflow", "nonsense"]

RENDER_IN_PROCESS = """
import sys
from pathlib import Path
from tests.jobs.town import open_town

town = open_town(Path(sys.argv[1]), float(sys.argv[3]))
print("started", flush=True)
statistics, events = town.run(int(sys.argv[2]))
print(statistics.done, statistics.lost_leases, flush=True)
town.close()
"""

SUSPENDED_COMMIT = """
import os, signal, time
from map3d.renderings.render_task import RenderTask
from tests.jobs.town import TIMEOUTS

object.__setattr__(TIMEOUTS, "heartbeat_s", 60.0)  # suspended during a heartbeat, the process would hold the database's lock
commit, commits = RenderTask.commit, []

def suspend_first(task, lease, response):
    commits.append(lease)
    if len(commits) == 1:
        os.kill(os.getpid(), signal.SIGSTOP)
        time.sleep(0.5)  # another thread may take the signal while this one continues
    return commit(task, lease, response)

RenderTask.commit = suspend_first
"""


@pytest.fixture
def undisturbed(tmp_path: Path, faults: Path) -> str:
    other = make_town(tmp_path / "undisturbed")
    other.run()
    digest = other.digest()
    other.close()
    return digest


def render_in_process(town: Town, workers: int, lease_s: float = LEASE_S, before: str = "") -> subprocess.Popen[str]:
    command = [sys.executable, "-c", before + RENDER_IN_PROCESS, str(town.workspace.root), str(workers), str(lease_s)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    return process


def suspend_with_a_lease(process: subprocess.Popen[str], town: Town) -> None:
    """Suspends a process while it holds a lease but no database lock, since a lock would never be released."""
    databases = [town.workspace.root / "catalogue.sqlite", town.workspace.store_path(town.rendering.name, VIEW)]
    for _ in range(200):
        os.kill(process.pid, signal.SIGSTOP)
        os.waitpid(process.pid, os.WUNTRACED)
        if not any(is_locked(path) for path in databases) and town.count(State.LEASED) == 1:
            return
        os.kill(process.pid, signal.SIGCONT)
        time.sleep(0.05)
    raise AssertionError("the process never held a lease without a lock")


def is_locked(path: Path) -> bool:
    with closing(sqlite3.connect(path, timeout=0.2, isolation_level=None)) as db:
        try:
            db.execute("BEGIN IMMEDIATE")
        except sqlite3.OperationalError:
            return True
        return False


def wait_for(town: Town, done: int) -> None:
    deadline = time.monotonic() + 120
    while town.count(State.DONE) < done:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def all_done(town: Town) -> bool:
    counts = town.catalogue.count_jobs("town-a")
    return counts[State.DONE] == sum(counts.values()) > JOBS


def test_run_does_every_job_once(town: Town) -> None:
    statistics, events = town.run()
    assert all_done(town)
    leases = [event.lease for event in events if isinstance(event, JobDone)]
    assert len({(lease.track, lease.block) for lease in leases}) == len(leases) == statistics.done > JOBS
    assert all(event.reason is None for event in events if isinstance(event, WorkerExited))
    assert statistics.failed_attempts == statistics.lost_leases == 0
    assert 0 < statistics.empty < statistics.done


def test_second_run_does_nothing(town: Town) -> None:
    town.run()
    assert town.run()[0].done == 0


@pytest.mark.parametrize("kind", FAULTS)
def test_only_the_faulty_block_is_quarantined(town: Town, faults: Path, kind: str) -> None:
    z = town.rendering.zmax - 3
    (faults / f"{z}-3-5").write_text(kind)
    statistics, _ = town.run()
    (job,) = town.catalogue.jobs("town-a", state=State.QUARANTINED)
    assert (job.block, job.attempts) == ((z, 3, 5), 3)
    assert job.reason
    assert town.count(State.TODO) == town.count(State.LEASED) == 0
    assert len([job for job in town.catalogue.jobs("town-a", state=State.DONE) if job.kind == "base"]) == JOBS - 1
    assert statistics.failed_attempts == 3
    (faults / f"{z}-3-5").unlink()
    assert town.catalogue.retry("town-a") == 1
    town.run()
    assert all_done(town)


@pytest.fixture(params=["sqlite", "mongodb"])
def town_of_each_home(request: pytest.FixtureRequest, tmp_path: Path, faults: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Town]:
    if request.param == "mongodb":
        monkeypatch.setenv(CATALOGUE_VARIABLE, f"{request.getfixturevalue('mongo_server')}/pool{uuid.uuid4().hex[:8]}")
    made = make_town(tmp_path / "workspace")
    yield made
    made.close()


def test_faults_of_every_kind_quarantine_only_the_faulty_blocks(town_of_each_home: Town, faults: Path) -> None:
    town = town_of_each_home
    z = town.rendering.zmax - 3
    for n, kind in enumerate(FAULTS):
        (faults / f"{z}-{n % 8}-{n // 8}").write_text(kind)
    town.run()
    quarantined = {job.block for job in town.catalogue.jobs("town-a", state=State.QUARANTINED)}
    assert quarantined == {(z, n % 8, n // 8) for n in range(len(FAULTS))}
    assert len([job for job in town.catalogue.jobs("town-a", state=State.DONE) if job.kind == "base"]) == JOBS - len(FAULTS)


@contextmanager
def locked(path: Path, seconds: float) -> Iterator[None]:
    """Holds the write lock of a database from now on, as a stuck process would."""
    db = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    db.execute("BEGIN IMMEDIATE")
    release = threading.Timer(seconds, lambda: db.execute("ROLLBACK"))
    release.start()
    try:
        yield
    finally:
        release.join()
        db.close()


def test_run_waits_while_the_catalogue_is_locked(town: Town, undisturbed: str) -> None:
    with locked(town.workspace.catalogue_path, 1.5):
        statistics, _ = town.run()
    assert all_done(town)
    assert statistics.failed_attempts == statistics.lost_leases == 0
    assert town.digest() == undisturbed


def test_run_ends_clearly_when_the_catalogue_stays_locked_and_can_be_repeated(town: Town, undisturbed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("map3d.catalogue.sqlite.BUSY_TIMEOUT_S", 0.2)
    impatient = open_town(town.workspace.root, LEASE_S)
    with locked(town.workspace.catalogue_path, 3.0), pytest.raises(StoreError, match=r"catalogue\.sqlite: cannot write: database is locked"):
        impatient.run()
    impatient.task.close()
    impatient.close()
    town.run()
    assert all_done(town)
    assert town.digest() == undisturbed


def test_reason_says_how_the_subprocess_ended(town: Town, faults: Path) -> None:
    z = town.rendering.zmax - 3
    words = {"segfault": "SIGSEGV", "exit 0": "exit status 0", "hang": "1.5 s", "exception": "ValueError: faulty block", "nonsense": "message"}
    for x, kind in enumerate(words):
        (faults / f"{z}-{x}-0").write_text(kind)
    town.run()
    reasons = {job.block.x: str(job.reason) for job in town.catalogue.jobs("town-a", state=State.QUARANTINED)}
    assert all(word in reasons[x] for x, word in enumerate(words.values())), list(reasons.values())


def test_killed_subprocesses_do_not_change_the_tiles(town: Town, faults: Path, undisturbed: str) -> None:
    """Each killed subprocess is replaced; the tiles equal those of an undisturbed run."""
    (faults / "slow").write_text("0.1")
    chance = random.Random(5)
    over = threading.Event()

    def kill_subprocesses() -> None:
        done = 0
        while not over.wait(0.05):
            if town.count(State.DONE) >= done + 3 and (children := children_of(os.getpid())):
                done = town.count(State.DONE)
                os.kill(chance.choice(children), signal.SIGKILL)

    killer = threading.Thread(target=kill_subprocesses)
    killer.start()
    statistics, _ = town.run()
    over.set()
    killer.join()
    town.catalogue.retry("town-a")
    town.run()
    assert statistics.failed_attempts > 3
    assert all_done(town)
    assert town.digest() == undisturbed


def test_subprocesses_killed_before_they_are_ready_are_replaced(town: Town, faults: Path) -> None:
    killed = 0
    over = threading.Event()

    def kill_starting() -> None:
        nonlocal killed
        while killed < 4 and not over.wait(0.01):
            for child in children_of(os.getpid()):
                os.kill(child, signal.SIGKILL)
                killed += 1

    killer = threading.Thread(target=kill_starting)
    killer.start()
    statistics, _ = town.run()
    over.set()
    killer.join()
    assert killed >= 4
    assert all_done(town)
    assert statistics.exit_reasons == []


def test_run_resumes_after_being_killed(town: Town, faults: Path, undisturbed: str) -> None:
    (faults / "slow").write_text("0.02")
    for round_ in range(3):
        process = render_in_process(town, 2)
        wait_for(town, 10 * (round_ + 1))
        process.kill()
        process.communicate()
    town.run()
    assert all_done(town)
    assert town.digest() == undisturbed


def test_leases_of_a_killed_run_are_free_at_once_and_cost_no_attempt(town: Town, faults: Path, undisturbed: str) -> None:
    for _ in range(3):
        (faults / "slow").write_text("1")
        process = render_in_process(town, 2, lease_s=30)
        deadline = time.monotonic() + 60
        while sum(f".{process.pid}." in str(job.worker) for job in town.catalogue.jobs("town-a", state=State.LEASED)) < 2:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        process.kill()
        process.communicate()
    (faults / "slow").unlink()
    started = time.monotonic()
    statistics, _ = town.run()
    assert time.monotonic() - started < 25
    assert all_done(town)
    assert statistics.failed_attempts == 0
    jobs = list(town.catalogue.jobs("town-a"))
    assert sum(job.expiries for job in jobs) == 6
    assert all(job.attempts == 1 for job in jobs)
    assert town.digest() == undisturbed


def test_waiting_run_frees_the_leases_of_a_process_that_is_killed_meanwhile(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("0.3")
    process = render_in_process(town, 1, lease_s=600)
    wait_for(town, 1)
    suspend_with_a_lease(process, town)
    (faults / "slow").unlink()

    def on_event(event: RunEvent) -> None:
        if isinstance(event, Waiting):
            process.kill()
            process.communicate()

    town.pool(timeouts=replace(TIMEOUTS, wait_s=0.3)).run(on_event)
    town.task.close()
    assert all_done(town)


def test_leases_of_a_running_process_stay(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("1")
    process = render_in_process(town, 1)
    wait_for(town, 1)
    (faults / "slow").unlink()
    statistics, _ = town.run()
    output, _ = process.communicate(timeout=60)
    assert statistics.lost_leases == int(output.split()[1]) == 0
    assert all_done(town)


def test_run_that_waits_for_another_runs_leases_reports_it_once(town: Town, faults: Path) -> None:
    other = town.workspace.open_catalogue(lease_s=60)
    held = other.lease("town-a", "other")
    assert held is not None
    waiting: list[Waiting] = []

    def on_event(event: RunEvent) -> None:
        if isinstance(event, Waiting):
            waiting.append(event)
            other.release(held)

    town.pool(timeouts=replace(TIMEOUTS, wait_s=0.3)).run(on_event)
    town.task.close()
    other.close()
    assert waiting == [Waiting(1)]
    assert all_done(town)


def test_subprocesses_die_with_their_parent(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("5")
    process = render_in_process(town, 2)
    deadline = time.monotonic() + 20
    while len(children := children_of(process.pid)) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.kill()
    process.communicate()
    while any(is_alive(pid) for pid in children):
        assert time.monotonic() < deadline + 10
        time.sleep(0.05)


def test_worker_suspended_past_its_lease_loses_it(town: Town, faults: Path, undisturbed: str) -> None:
    (faults / "slow").write_text("0.3")
    process = render_in_process(town, 1)
    wait_for(town, 1)
    suspend_with_a_lease(process, town)
    (faults / "slow").unlink()
    town.run()
    assert all_done(town)
    os.kill(process.pid, signal.SIGCONT)
    output, _ = process.communicate(timeout=30)
    assert int(output.split()[1]) == 1, "the suspended worker must lose its lease"
    assert town.digest() == undisturbed


def test_worker_suspended_before_its_commit_does_not_overwrite_newer_tiles(town: Town, faults: Path) -> None:
    process = render_in_process(town, 1, lease_s=60.0, before=SUSPENDED_COMMIT)
    try:
        os.waitpid(process.pid, os.WUNTRACED)
        (faults / "salt").write_text("changed")
        town.catalogue.plan("town-a", planned_jobs(town.rendering, "changed"))
        town.run(timeouts=replace(TIMEOUTS, block_s=30))
        assert all_done(town)
        newer = town.digest()
        os.kill(process.pid, signal.SIGCONT)
        output, _ = process.communicate(timeout=30)
    finally:
        process.kill()
        process.communicate()
    assert output.split() == ["0", "1"], "no block done, one lease lost"
    assert town.digest() == newer
    with SqliteTileStore(town.workspace.store_path("town-a", VIEW), read_only=True) as store:
        assert all(block.key.startswith("changed") for block in store.list_blocks())


def test_heartbeats_continue_during_a_long_commit(town: Town, faults: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commit = RenderTask.commit

    def slow_commit(task: RenderTask, lease: Lease, response: Message) -> JobResult:
        time.sleep(LEASE_S * 1.5)
        return commit(task, lease, response)

    monkeypatch.setattr(RenderTask, "commit", slow_commit)
    pool = town.pool(size=1)
    events: list[RunEvent] = []

    def on_event(event: RunEvent) -> None:
        events.append(event)
        pool.stop.finish_jobs()

    pool.run(on_event)
    town.task.close()
    assert {type(event) for event in events} - {Stopping, Remaining} == {JobDone, WorkerExited}


def test_worker_exits_after_three_failed_jobs(town: Town, faults: Path) -> None:
    z = town.rendering.zmax - 3
    for x in range(BLOCKS):
        for y in range(BLOCKS):
            (faults / f"{z}-{x}-{y}").write_text("exception")
    statistics, _ = town.run(size=1)
    assert statistics.failed_attempts == 3
    assert [reason.rpartition(": ")[2] for reason in statistics.exit_reasons] == ["failed 3 different jobs"]
    assert town.count(State.TODO) == JOBS


def test_failed_start_does_not_count_as_an_attempt(town: Town, faults: Path) -> None:
    (faults / "no-start").touch()
    statistics, _ = town.run()
    assert (statistics.done, statistics.failed_attempts) == (0, 0)
    assert all("cannot start" in reason for reason in statistics.exit_reasons)
    assert all(job.attempts == 0 for job in town.catalogue.jobs("town-a"))


def test_stop_finishes_the_current_jobs(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("0.3")
    pool = town.pool()
    events: list[RunEvent] = []

    def on_event(event: RunEvent) -> None:
        events.append(event)
        pool.stop.finish_jobs()

    statistics = pool.run(on_event)
    town.task.close()
    assert 1 <= statistics.done <= 3
    assert statistics.lost_leases == statistics.failed_attempts == town.count(State.LEASED) == 0


def test_stop_now_releases_jobs_without_counting_the_attempt(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("60")
    pool = town.pool(timeouts=Timeouts(heartbeat_s=0.5, block_s=100, tick_s=0.1))
    timer = threading.Timer(1.5, pool.stop.release_jobs)
    timer.start()
    started = time.monotonic()
    statistics = pool.run(lambda _: None)
    town.task.close()
    assert time.monotonic() - started < 10
    assert statistics.done == 0
    assert all((job.state, job.attempts) in ((State.TODO, 0), (State.WAITING, 0)) for job in town.catalogue.jobs("town-a"))


def test_heartbeats_keep_the_lease_of_a_long_block(town: Town, faults: Path) -> None:
    (faults / "slow").write_text(str(LEASE_S * 1.5))
    pool = town.pool(size=1, timeouts=Timeouts(heartbeat_s=0.5, block_s=30, tick_s=0.1))
    kinds: list[type] = []

    def on_event(event: RunEvent) -> None:
        kinds.append(type(event))
        pool.stop.finish_jobs()

    pool.run(on_event)
    town.task.close()
    assert set(kinds) - {Stopping, Remaining} == {JobDone, WorkerExited}


def children_of(pid: int) -> list[int]:
    """Returns the subprocesses of map3d, not the servers that other tests have started."""
    return [child for child in all_children_of(pid) if "map3d.subprocess" in command_of(child)]


def command_of(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


def all_children_of(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            found += [int(child) for child in (task / "children").read_text().split()]
        except OSError:
            continue
    return found


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


assert TIMEOUTS.failures == 3
