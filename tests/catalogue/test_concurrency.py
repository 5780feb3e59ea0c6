"""Leases with several processes that compete for the same jobs."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from map3d.catalogue import JobResult, PlannedJob, SceneRecord, State
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.types import BlockId
from tests.catalogue.implementations import rendering

PROCESSES, JOBS = 4, 200

TAKE_ALL = """
import json, sys
from pathlib import Path
from map3d.catalogue import JobResult
from map3d.catalogue.sqlite import SqliteCatalogue

catalogue = SqliteCatalogue(Path(sys.argv[1]))
taken = []
while (lease := catalogue.lease("town-a", sys.argv[2])) is not None:
    catalogue.done(lease, JobResult(1, False))
    taken.append([lease.block.x, lease.fence])
catalogue.close()
print(json.dumps(taken))
"""

HOLD_ONE = """
import sys, time
from pathlib import Path
from map3d.catalogue.sqlite import SqliteCatalogue

from tests.catalogue.implementations import rendering

lease = SqliteCatalogue(Path(sys.argv[1]), lease_s=float(sys.argv[2])).lease("town-a", "held")
print(lease.fence, flush=True)
time.sleep(60)
"""


def prepared(path: Path, jobs: int, lease_s: float = 60) -> SqliteCatalogue:
    catalogue = SqliteCatalogue(path, lease_s=lease_s)
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    catalogue.plan("town-a", [PlannedJob("0-45", BlockId(10, x, 0), "base", x, "k", None) for x in range(jobs)])
    return catalogue


def test_processes_never_lease_a_job_twice(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    catalogue = prepared(path, JOBS)
    command = [sys.executable, "-c", TAKE_ALL, str(path)]
    started = [subprocess.Popen([*command, f"w{n}"], stdout=subprocess.PIPE, text=True) for n in range(PROCESSES)]
    taken = [row for process in started for row in json.loads(process.communicate(timeout=60)[0])]
    assert sorted(x for x, _ in taken) == list(range(JOBS))
    assert catalogue.count_jobs("town-a")[State.DONE] == JOBS
    catalogue.close()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_job_of_a_dead_or_suspended_process_is_leased_again(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "catalogue.sqlite"
    catalogue = prepared(path, 1, lease_s=1)
    holder = subprocess.Popen([sys.executable, "-c", HOLD_ONE, str(path), "1"], stdout=subprocess.PIPE, text=True)
    assert holder.stdout is not None
    fence = int(holder.stdout.readline())
    os.kill(holder.pid, number)
    deadline = time.monotonic() + 10
    while (lease := catalogue.lease("town-a", "mine")) is None:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    assert lease.fence > fence
    catalogue.done(lease, JobResult(1, False))
    holder.kill()
    holder.communicate()
    catalogue.close()
