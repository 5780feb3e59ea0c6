"""Real faults against a real pool: children die in every way there is, and nothing but the poisoned is lost."""

import os
import random
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.catalogue import State
from map3d.jobs.events import Done, Event, Left, Waiting
from map3d.jobs.timeouts import Terms
from tests.jobs.town import BLOCKS, LEASE_S, TERMS, VIEW, Town, make_town

JOBS = BLOCKS * BLOCKS
POISON = ["segfault", "abort", "killed", "hang", "spin", "exception", "exit 0", "memory", "nonsense"]

RENDER_IN_PROCESS = """
import sys
from pathlib import Path
from tests.jobs.town import open_town

town = open_town(Path(sys.argv[1]))
print("started", flush=True)
tally, events = town.run(int(sys.argv[2]))
print(tally.done, tally.lost_leases, flush=True)
town.close()
"""


@pytest.fixture
def undisturbed(tmp_path: Path, faults: Path) -> str:
    other = make_town(tmp_path / "undisturbed")
    other.run()
    digest = other.digest()
    other.close()
    return digest


def render_in_process(town: Town, workers: int) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", RENDER_IN_PROCESS, str(town.workspace.root), str(workers)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    return process


def freeze_with_a_lease(process: subprocess.Popen[str], town: Town) -> None:
    """Stops a process while it holds a lease and no lock of a database, which nobody could take from it."""
    databases = [town.workspace.root / "catalogue.sqlite", town.workspace.store_path(town.rendering.name, VIEW)]
    for _ in range(200):
        os.kill(process.pid, signal.SIGSTOP)
        os.waitpid(process.pid, os.WUNTRACED)
        if not any(is_locked(path) for path in databases) and town.count(State.LEASED) == 1:
            return
        os.kill(process.pid, signal.SIGCONT)
        time.sleep(0.05)
    raise AssertionError("never found with a lease and without a lock")


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


def test_a_run_does_every_job_once(town: Town) -> None:
    tally, events = town.run()
    assert all_done(town)
    leases = [event.lease for event in events if isinstance(event, Done)]
    assert len({(lease.track, lease.block) for lease in leases}) == len(leases) == tally.done > JOBS
    assert all(event.because == "" for event in events if isinstance(event, Left))
    assert tally.failed_attempts == tally.lost_leases == 0
    assert 0 < tally.empty < tally.done


def test_a_second_run_does_nothing(town: Town) -> None:
    town.run()
    assert town.run()[0].done == 0


@pytest.mark.parametrize("kind", POISON)
def test_only_the_poisoned_block_is_quarantined(town: Town, faults: Path, kind: str) -> None:
    z = town.rendering.zmax - 3
    (faults / f"{z}-3-5").write_text(kind)
    tally, _ = town.run()
    (job,) = town.catalogue.jobs("town-a", state=State.QUARANTINED)
    assert (job.block, job.attempts) == ((z, 3, 5), 3)
    assert job.reason
    assert town.count(State.TODO) == town.count(State.LEASED) == 0
    assert len([job for job in town.catalogue.jobs("town-a", state=State.DONE) if job.kind == "base"]) == JOBS - 1
    assert tally.failed_attempts == 3
    (faults / f"{z}-3-5").unlink()
    assert town.catalogue.retry("town-a") == 1
    town.run()
    assert all_done(town)


def test_poison_of_every_kind_at_once_costs_only_the_poisoned(town: Town, faults: Path) -> None:
    z = town.rendering.zmax - 3
    for n, kind in enumerate(POISON):
        (faults / f"{z}-{n % 8}-{n // 8}").write_text(kind)
    town.run()
    quarantined = {job.block for job in town.catalogue.jobs("town-a", state=State.QUARANTINED)}
    assert quarantined == {(z, n % 8, n // 8) for n in range(len(POISON))}
    assert len([job for job in town.catalogue.jobs("town-a", state=State.DONE) if job.kind == "base"]) == JOBS - len(POISON)


def test_reasons_say_how_a_child_ended(town: Town, faults: Path) -> None:
    z = town.rendering.zmax - 3
    words = {"segfault": "SIGSEGV", "exit 0": "exit status 0", "hang": "1.5 s", "exception": "ValueError: poison", "nonsense": "message"}
    for x, kind in enumerate(words):
        (faults / f"{z}-{x}-0").write_text(kind)
    town.run()
    reasons = {job.block.x: job.reason or "" for job in town.catalogue.jobs("town-a", state=State.QUARANTINED)}
    assert all(word in reasons[x] for x, word in enumerate(words.values())), list(reasons.values())


def test_killed_children_cost_nothing(town: Town, faults: Path, undisturbed: str) -> None:
    """A new child starts every time; the tiles are those of an undisturbed run."""
    (faults / "slow").write_text("0.1")
    chance = random.Random(5)
    over = threading.Event()

    def kill_children() -> None:
        done = 0
        while not over.wait(0.05):
            if town.count(State.DONE) >= done + 3 and (children := children_of(os.getpid())):
                done = town.count(State.DONE)
                os.kill(chance.choice(children), signal.SIGKILL)

    killer = threading.Thread(target=kill_children)
    killer.start()
    tally, _ = town.run()
    over.set()
    killer.join()
    town.catalogue.retry("town-a")
    town.run()
    assert tally.failed_attempts > 3
    assert all_done(town)
    assert town.digest() == undisturbed


def test_children_killed_before_they_are_ready_are_replaced(town: Town, faults: Path) -> None:
    killed = 0
    over = threading.Event()

    def kill_starters() -> None:
        nonlocal killed
        while killed < 4 and not over.wait(0.01):
            for child in children_of(os.getpid()):
                os.kill(child, signal.SIGKILL)
                killed += 1

    killer = threading.Thread(target=kill_starters)
    killer.start()
    tally, _ = town.run()
    over.set()
    killer.join()
    assert killed >= 4
    assert all_done(town)
    assert tally.left_early == []


def test_killing_the_whole_run_loses_nothing(town: Town, faults: Path, undisturbed: str) -> None:
    (faults / "slow").write_text("0.02")
    for round_ in range(3):
        process = render_in_process(town, 2)
        wait_for(town, 10 * (round_ + 1))
        process.kill()
        process.communicate()
    town.run()
    assert all_done(town)
    assert town.digest() == undisturbed


def test_a_run_that_can_only_wait_for_leases_of_others_says_so_once(town: Town, faults: Path) -> None:
    other = town.workspace.open_catalogue(lease_s=60)
    held = other.lease("town-a", "other")
    assert held is not None
    told: list[Waiting] = []

    def on_event(event: Event) -> None:
        if isinstance(event, Waiting):
            told.append(event)
            other.release(held)

    town.pool(terms=replace(TERMS, wait_s=0.3)).run(on_event)
    town.task.close()
    other.close()
    assert told == [Waiting(1)]
    assert all_done(town)


def test_children_die_with_their_parent(town: Town, faults: Path) -> None:
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


def test_a_worker_frozen_past_its_lease_is_refused(town: Town, faults: Path, undisturbed: str) -> None:
    (faults / "slow").write_text("0.3")
    process = render_in_process(town, 1)
    wait_for(town, 1)
    freeze_with_a_lease(process, town)
    (faults / "slow").unlink()
    town.run()
    assert all_done(town)
    os.kill(process.pid, signal.SIGCONT)
    output, _ = process.communicate(timeout=30)
    assert int(output.split()[1]) == 1, "the frozen worker's lease must be lost"
    assert town.digest() == undisturbed


def test_a_worker_that_fails_everything_leaves_after_three_jobs(town: Town, faults: Path) -> None:
    z = town.rendering.zmax - 3
    for x in range(BLOCKS):
        for y in range(BLOCKS):
            (faults / f"{z}-{x}-{y}").write_text("exception")
    tally, _ = town.run(size=1)
    assert tally.failed_attempts == 3
    assert tally.left_early == ["local-1: failed 3 different jobs"]
    assert town.count(State.TODO) == JOBS


def test_a_child_that_cannot_start_costs_no_job_an_attempt(town: Town, faults: Path) -> None:
    (faults / "no-start").touch()
    tally, _ = town.run()
    assert (tally.done, tally.failed_attempts) == (0, 0)
    assert all("told not to start" in because for because in tally.left_early)
    assert all(job.attempts == 0 for job in town.catalogue.jobs("town-a"))


def test_stop_finishes_the_jobs_in_hand(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("0.3")
    pool = town.pool()
    events: list[Event] = []

    def on_event(event: Event) -> None:
        events.append(event)
        pool.stop()

    tally = pool.run(on_event)
    town.task.close()
    assert 1 <= tally.done <= 3
    assert tally.lost_leases == tally.failed_attempts == town.count(State.LEASED) == 0


def test_abandon_gives_jobs_back_without_counting_the_attempt(town: Town, faults: Path) -> None:
    (faults / "slow").write_text("60")
    pool = town.pool(terms=Terms(heartbeat_s=0.5, block_s=100, tick_s=0.1))
    timer = threading.Timer(1.5, pool.abandon)
    timer.start()
    begun = time.monotonic()
    tally = pool.run(lambda _: None)
    town.task.close()
    assert time.monotonic() - begun < 10
    assert tally.done == 0
    assert all((job.state, job.attempts) in ((State.TODO, 0), (State.WAITING, 0)) for job in town.catalogue.jobs("town-a"))


def test_a_long_block_is_held_by_heartbeats(town: Town, faults: Path) -> None:
    (faults / "slow").write_text(str(LEASE_S * 1.5))
    pool = town.pool(size=1, terms=Terms(heartbeat_s=0.5, block_s=30, tick_s=0.1))
    kinds: list[type] = []

    def on_event(event: Event) -> None:
        kinds.append(type(event))
        pool.stop()

    pool.run(on_event)
    town.task.close()
    assert set(kinds) == {Done, Left}


def children_of(pid: int) -> list[int]:
    """Without the process that Python's multiprocessing keeps for itself."""
    return [child for child in all_children_of(pid) if "resource_tracker" not in command_of(child)]


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


assert TERMS.failures == 3
