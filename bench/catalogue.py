"""Overhead of the catalogue: time per job, leases a second with many processes, speed and memory of planning.

`python -m bench catalogue [--catalogues URL…] [--jobs N…]`. Without URLs it measures SQLite in a temporary folder and, if Java is installed, the
test server that stands for MongoDB. That server searches all jobs for each lease, so its figures say nothing about a real one. To measure a real
one, give its URL without a database.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

from rich.console import Console
from rich.table import Table

from map3d.catalogue import Catalogue, JobResult, PlannedJob, RenderingRecord, SceneRecord, open_catalogue
from map3d.geometry.frames import pin
from map3d.geometry.morton import from_morton
from map3d.types import BlockId, Layer, ViewAngles

PROCESSES = (1, 8, 32)
OVERHEAD_JOBS, LEASED_JOBS, PLANNED_JOBS = 500, 2_000, (20_000, 100_000, 1_000_000)
TEST_SERVER, TEST_SERVER_JOBS = "MongoDB test server", 20_000
"""The test server loses pages of its file during searches of 100,000 jobs."""
BASE_LEVEL = 12
BOX = ((0.0, 0.0, 0.0), (100.0, 100.0, 10.0))
RESULT = JobResult(1, False, 85, 64, 1_000_000, 1.0, (1 << 64) - 1)

LEASE_ALL = """
import sys, time
from map3d.catalogue import JobResult, open_catalogue

catalogue = open_catalogue(sys.argv[1])
catalogue.has_open_jobs("r")
print("ready", flush=True)
sys.stdin.readline()
while (lease := catalogue.lease("r", sys.argv[2])) is not None:
    catalogue.done(lease, JobResult(1, False, occupied=0))
catalogue.close()
"""
PLAN = """
import json, resource, sys, time
from bench.catalogue import planned_jobs
from map3d.catalogue import open_catalogue

catalogue = open_catalogue(sys.argv[1])
catalogue.count_jobs("r")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
times = []
for _ in range(2):
    begin = time.perf_counter()
    catalogue.plan("r", planned_jobs(int(sys.argv[2])))
    times.append(time.perf_counter() - begin)
begin = time.perf_counter()
counts = catalogue.count_jobs("r")
times.append(time.perf_counter() - begin)
begin = time.perf_counter()
jobs = sum(1 for _ in catalogue.jobs("r"))
times.append(time.perf_counter() - begin)
after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
catalogue.close()
assert jobs == sum(counts.values())
print(json.dumps({"jobs": jobs, "times": times, "kib": after - before}))
"""


@dataclass(frozen=True)
class OverheadRow:
    """Mean milliseconds of each call; `total_ms`: a lease, a heartbeat and a done."""

    catalogue: str
    lease_ms: float
    heartbeat_ms: float
    done_ms: float
    total_ms: float


@dataclass(frozen=True)
class RateRow:
    """Jobs leased and done a second by a number of processes together."""

    catalogue: str
    processes: int
    jobs_per_s: float


@dataclass(frozen=True)
class PlanRow:
    """`again_s`: the same plan once more; `extra_mib`: growth of the process's memory during all of them."""

    catalogue: str
    jobs: int
    plan_s: float
    again_s: float
    count_ms: float
    list_s: float
    extra_mib: float


def measure(urls: Sequence[str] = (), planned: Sequence[int] = PLANNED_JOBS) -> list[dict[str, Any]]:
    rows: list[OverheadRow | RateRow | PlanRow] = []
    with new_catalogues(urls) as catalogues:
        for name, new_url in catalogues.items():
            rows.append(measure_overhead(name, new_url()))
            rows += [measure_rate(name, new_url(), processes) for processes in PROCESSES]
            rows += [measure_plan(name, new_url(), jobs) for jobs in planned if name != TEST_SERVER or jobs <= TEST_SERVER_JOBS]
    for kind in (OverheadRow, RateRow, PlanRow):
        _print([asdict(row) for row in rows if isinstance(row, kind)])
    return [asdict(row) for row in rows]


def measure_overhead(name: str, url: str) -> OverheadRow:
    catalogue = _prepared(url, OVERHEAD_JOBS)
    times = {"lease": 0.0, "heartbeat": 0.0, "done": 0.0}

    def timed(word: str, call: Callable[[], Any]) -> Any:
        begin = time.perf_counter()
        answer = call()
        times[word] += time.perf_counter() - begin
        return answer

    count = 0
    while (lease := timed("lease", lambda: catalogue.lease("r", "w", 1))) is not None:
        held = lease
        timed("heartbeat", lambda held=held: catalogue.heartbeat(held))
        timed("done", lambda held=held: catalogue.done(held, RESULT))
        count += 1
    catalogue.close()
    means = [1000 * seconds / count for seconds in times.values()]
    return OverheadRow(name, *means, sum(means))


def measure_rate(name: str, url: str, processes: int) -> RateRow:
    catalogue = _prepared(url, LEASED_JOBS)
    command = [sys.executable, "-c", LEASE_ALL, url]
    started = [subprocess.Popen([*command, f"w{n}"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for n in range(processes)]
    for process in started:
        assert process.stdout is not None
        process.stdout.readline()
    begin = time.perf_counter()
    for process in started:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in started:
        process.communicate()
    seconds = time.perf_counter() - begin
    done = sum(1 for job in catalogue.jobs("r") if job.result is not None)
    catalogue.close()
    return RateRow(name, processes, done / seconds)


def measure_plan(name: str, url: str, jobs: int) -> PlanRow:
    _prepared(url, 0).close()
    run = subprocess.run([sys.executable, "-c", PLAN, url, str(jobs)], stdout=subprocess.PIPE, text=True, check=True)
    found = json.loads(run.stdout)
    plan_s, again_s, count_s, list_s = found["times"]
    return PlanRow(name, found["jobs"], plan_s, again_s, 1000 * count_s, list_s, found["kib"] / 1024)


def planned_jobs(bases: int) -> Iterator[PlannedJob]:
    """Yields base blocks in Morton order, and the reduce blocks above them, level by level."""
    count, level = bases, BASE_LEVEL
    while True:
        for number in range(count):
            block = BlockId(level, *from_morton(number))
            above = None if level == 0 else BlockId(level - 3, block.x >> 3, block.y >> 3)
            yield PlannedJob("0-45", block, "base" if level == BASE_LEVEL else "reduce", number, f"{number:032x}", above)
        if level == 0:
            return
        count, level = -(-count // 64), level - 3


def _prepared(url: str, bases: int) -> Catalogue:
    catalogue = open_catalogue(url)
    frames = tuple(pin(BOX, 256, 0.01, [ViewAngles(0, 45)]))
    catalogue.create_scene(SceneRecord("s"))
    catalogue.create_rendering(RenderingRecord("r", "s", 0.01, ((Layer("color", "color", "webp", 80),),), frames, BOX))
    if bases:
        catalogue.plan("r", planned_jobs(bases))
    return catalogue


@contextmanager
def new_catalogues(urls: Sequence[str]) -> Iterator[dict[str, Callable[[], str]]]:
    """Gives, for each catalogue to measure, its name and a function that returns the URL of an empty one."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-")))
        found: dict[str, Callable[[], str]] = {url: _new_database(url) for url in urls}
        if not urls:
            found["SQLite"] = lambda: f"sqlite://{folder / uuid4().hex}.sqlite"
            if server := _start_test_server(folder, stack):
                found[TEST_SERVER] = _new_database(server)
        yield found


def _new_database(server: str) -> Callable[[], str]:
    return lambda: f"{server.rstrip('/')}/bench_{uuid4().hex[:12]}"


def _start_test_server(folder: Path, stack: ExitStack) -> str | None:
    from tests.catalogue.mongo_process import MongoProcess, Unavailable, build

    try:
        build()
        server = MongoProcess(folder).start()
    except Unavailable as error:
        Console(stderr=True).print(f"skipping MongoDB: {error}")
        return None
    stack.callback(server.stop)
    return server.url


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table(*rows[0])
    for row in rows:
        table.add_row(*(f"{value:,.1f}" if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else value for value in row.values()))
    Console(width=160).print(table)
