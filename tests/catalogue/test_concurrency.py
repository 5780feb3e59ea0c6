"""Leases with several processes that compete for the same jobs."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from map3d.catalogue import Catalogue, JobResult, PlannedJob, SceneRecord, State, open_catalogue
from map3d.types import BlockId
from tests.catalogue.implementations import NewUrl, new_urls, rendering
from tests.catalogue.pyramids import is_bottom_up, pyramid

PROCESSES, JOBS = 4, 200
IMPLEMENTATIONS = ("mongodb", "sqlite")

TAKE_ALL = """
import json, sys
from map3d.catalogue import JobResult, open_catalogue

catalogue = open_catalogue(sys.argv[1])
taken = []
while catalogue.has_open_jobs("town-a"):
    if (lease := catalogue.lease("town-a", sys.argv[2])) is not None:
        catalogue.done(lease, JobResult(1, False))
        taken.append([lease.track, *lease.block, lease.fence])
catalogue.close()
print(json.dumps(taken))
"""

HOLD_ONE = """
import sys, time
from map3d.catalogue import open_catalogue

lease = open_catalogue(sys.argv[1], lease_s=float(sys.argv[2])).lease("town-a", "held")
print(lease.fence, flush=True)
time.sleep(60)
"""


@pytest.fixture(params=IMPLEMENTATIONS)
def new_url(request: pytest.FixtureRequest, tmp_path: os.PathLike[str]) -> object:
    with new_urls(request.param, request, tmp_path) as new:
        yield new


def prepared(url: str, jobs: list[PlannedJob], lease_s: float = 60) -> Catalogue:
    catalogue = open_catalogue(url, lease_s=lease_s)
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    catalogue.plan("town-a", jobs)
    return catalogue


def bases(count: int) -> list[PlannedJob]:
    return [PlannedJob("0-45", BlockId(10, x, 0), "base", x, "k", None) for x in range(count)]


def taken_by_processes(url: str) -> list[list[list[object]]]:
    command = [sys.executable, "-c", TAKE_ALL, url]
    started = [subprocess.Popen([*command, f"w{n}"], stdout=subprocess.PIPE, text=True) for n in range(PROCESSES)]
    return [json.loads(process.communicate(timeout=120)[0]) for process in started]


def test_processes_never_lease_a_job_twice(new_url: NewUrl) -> None:
    url = new_url()
    catalogue = prepared(url, bases(JOBS))
    taken = [row[2] for rows in taken_by_processes(url) for row in rows]
    assert sorted(taken) == list(range(JOBS))
    assert catalogue.count_jobs("town-a")[State.DONE] == JOBS
    catalogue.close()


def test_processes_do_a_pyramid_from_the_bottom_and_leave_no_job_waiting(new_url: NewUrl) -> None:
    """The last two jobs below a reduce job often end at the same time."""
    url = new_url()
    tracks = [f"{n}-45" for n in range(12)]
    catalogue = prepared(url, pyramid(tracks=tracks))
    rows = [row for rows in taken_by_processes(url) for row in rows]
    assert len(rows) == len({tuple(row[:4]) for row in rows}) == len(pyramid(tracks=tracks))
    assert catalogue.sweep("town-a") == 0
    assert catalogue.count_jobs("town-a")[State.DONE] == len(rows)
    for rows in taken_by_processes(url):
        assert rows == []
    catalogue.close()


def test_jobs_opened_while_processes_work_are_done_from_the_bottom(new_url: NewUrl) -> None:
    """A plan changes every base block again and again while other processes work; at the end all jobs are done under their last key."""
    url = new_url()
    catalogue = prepared(url, pyramid("aaaa"))
    command = [sys.executable, "-c", TAKE_ALL, url]
    for keys in ("bbbb", "baba", "cabc", "dddd"):
        started = [subprocess.Popen([*command, f"w{n}"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) for n in range(2)]
        catalogue.plan("town-a", pyramid(keys))
        for process in started:
            errors = process.communicate(timeout=120)[1]
            assert process.returncode == 0 or "StaleFence" in errors, errors
    catalogue.expire("town-a", ["w0", "w1"])
    blocks: dict[str, list[BlockId]] = {}
    while catalogue.sweep("town-a") or catalogue.has_open_jobs("town-a"):
        while (lease := catalogue.lease("town-a", "last")) is not None:
            catalogue.done(lease, JobResult(1, False))
            blocks.setdefault(lease.track, []).append(lease.block)
    assert all(is_bottom_up(each) for each in blocks.values())
    expected = sorted(pyramid("dddd"), key=lambda job: (job.track, job.block.z, job.order))
    assert [(job.track, job.block, job.key, job.state) for job in catalogue.jobs("town-a")] == [
        (job.track, job.block, job.key, State.DONE) for job in expected
    ]
    catalogue.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_job_of_a_dead_or_suspended_process_is_leased_again(new_url: NewUrl, number: signal.Signals) -> None:
    url = new_url()
    catalogue = prepared(url, bases(1), lease_s=1)
    holder = subprocess.Popen([sys.executable, "-c", HOLD_ONE, url, "1"], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    fence = int(holder.stdout.readline())
    os.kill(holder.pid, number)
    deadline = time.monotonic() + 30
    while (lease := catalogue.lease("town-a", "mine")) is None:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert lease.fence > fence
    catalogue.done(lease, JobResult(1, False))
    holder.kill()
    holder.communicate()
    catalogue.close()
