"""A thousand simulated workers on the real catalogue: how many leases a second it serves, and how long a worker waits for it.

A simulated worker leases a job, sleeps for the time that a block takes, and marks the job as done. Everything but the rendering is real: the
database, its clock, its transactions. Workers are threads of some processes, as many nodes would be.
"""

import multiprocessing
import random
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any, Final
from uuid import uuid4

from rich.console import Console
from rich.table import Table

from map3d.catalogue import JobResult, PlannedJob, RenderingRecord, SceneRecord, Workspace
from map3d.geometry.frames import pin
from map3d.tiles.naming import morton
from map3d.types import BlockId, Layer, ViewAngles

BLOCK_S: Final = (32.0, 8.0, 2.0, 0.5)
"""Seconds that a block takes: a block of 16 × 16 base tiles takes four times as long as one of 8 × 8."""
WORKERS: Final = 1000
PROCESSES: Final = 8
WARM_UP_S: Final = 5.0
MEASURE_S: Final = 15.0
JOBS: Final = 60_000
NAME: Final = "country"
LAYERS: Final = (Layer("color", "color", "webp", 80),)
BOX: Final = ((0.0, 0.0, 0.0), (500_000.0, 500_000.0, 10.0))


@dataclass(frozen=True)
class SaturationRow:
    """`offered`: blocks per second that the workers could render; `leased`: that they got. `wait_ms`, `p99_ms`: time that the catalogue takes for one
    block (lease and done): median and 99th percentile. `busy`: share of their time in which workers render."""

    home: str
    workers: int
    block_s: float
    offered: float
    leased: float
    busy: float
    wait_ms: float
    p99_ms: float


def measure(
    catalogue_urls: Sequence[str] = (), jobs: int = JOBS, workers: int = WORKERS, blocks_s: Sequence[float] = BLOCK_S
) -> list[dict[str, Any]]:
    """Measures SQLite in a temporary folder and the MongoDB servers at the URLs (without a database), and prints the table."""
    rows = []
    for home in ("sqlite", *catalogue_urls):
        for block_s in blocks_s:
            with tempfile.TemporaryDirectory(prefix="map3d-saturation-") as folder:
                rows.append(_measure_one(_workspace(Path(folder), home), home, workers, block_s, jobs))
    table = Table(title=f"{workers:,} simulated workers", title_justify="left")
    for column in ("catalogue", "seconds a block", "blocks/s offered", "blocks/s leased", "workers busy", "catalogue, ms a block", "99 %, ms"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row.home.partition(":")[0],
            f"{row.block_s:g}",
            f"{row.offered:,.0f}",
            f"{row.leased:,.0f}",
            f"{row.busy:.0%}",
            f"{row.wait_ms:.1f}",
            f"{row.p99_ms:.0f}",
        )
    Console().print(table)
    return [asdict(row) for row in rows]


def _workspace(folder: Path, home: str) -> Workspace:
    return Workspace(folder, None if home == "sqlite" else f"{home.rstrip('/')}/saturation{uuid4().hex[:8]}")


def _measure_one(workspace: Workspace, home: str, workers: int, block_s: float, jobs: int) -> SaturationRow:
    catalogue = workspace.create().open_catalogue()
    catalogue.create_scene(SceneRecord(NAME))
    frames = tuple(pin(BOX, 256, 1.0, [ViewAngles(0, 45)]))
    catalogue.create_rendering(RenderingRecord(NAME, NAME, 1.0, (LAYERS,), frames, BOX))
    catalogue.plan(NAME, _jobs(frames[0].zmax, jobs))
    catalogue.close()
    results: Queue[list[tuple[float, float]]] = multiprocessing.Queue()
    start = time.time() + 3.0
    each = workers // PROCESSES
    nodes = [multiprocessing.Process(target=_node, args=(workspace, number, each, block_s, start, results)) for number in range(PROCESSES)]
    for node in nodes:
        node.start()
    samples = [sample for _ in nodes for sample in results.get()]
    for node in nodes:
        node.join()
    begin = start + WARM_UP_S
    waits = sorted(1000.0 * wait for end, wait in samples if begin <= end < begin + MEASURE_S)
    leased, offered = len(waits) / MEASURE_S, each * PROCESSES / block_s
    percentile = [waits[int(len(waits) * share)] if waits else 0.0 for share in (0.5, 0.99)]
    return SaturationRow(home, each * PROCESSES, block_s, offered, leased, min(leased / offered, 1.0), *percentile)


def _jobs(zmax: int, jobs: int) -> Iterator[PlannedJob]:
    level, side = zmax - 3, 1 << ((jobs - 1).bit_length() + 1) // 2
    for number in range(jobs):
        x, y = number % side, number // side
        yield PlannedJob("0-45", BlockId(level, x, y), "base", morton(x, y), f"key {x} {y}", None)


def _node(workspace: Workspace, number: int, workers: int, block_s: float, start: float, results: "Queue[list[tuple[float, float]]]") -> None:
    catalogue, samples = workspace.open_catalogue(), []
    end = start + WARM_UP_S + MEASURE_S

    def work(worker: int) -> None:
        choose = random.Random(number * 10_000 + worker)
        time.sleep(max(0.0, start - time.time()) + choose.uniform(0, min(block_s, WARM_UP_S)))
        first = True
        while time.time() < end:
            begun = time.perf_counter()
            lease = catalogue.lease(NAME, f"node{number}.{worker}", choose.randrange(1 << 16))
            if lease is None:
                return
            leased = time.perf_counter()
            time.sleep(block_s * (choose.random() if first else choose.uniform(0.8, 1.2)))
            first = False
            rendered = time.perf_counter()
            catalogue.done(lease, JobResult(1, False, 85, 64, 1 << 20, block_s))
            samples.append((time.time(), leased - begun + time.perf_counter() - rendered))

    threads = [threading.Thread(target=work, args=(worker,)) for worker in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    catalogue.close()
    results.put(samples)
