"""The catalogue's share of a render: time that workers wait for leases, heartbeats and commits of jobs, on SQLite and on MongoDB.

`python -m bench overhead [--catalogues URL…]` renders the town of `bench incremental` with each catalogue.
"""

import os
import subprocess
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from map3d.catalogue import Workspace
from map3d.catalogue.workspace import CATALOGUE_VARIABLE
from map3d.jobs.run import Run
from map3d.jobs.run_settings import RunSettings

from .benchmark_scene import CACHE
from .catalogue import new_catalogues
from .incremental import MAP3D

BUILDINGS, FILES, LEVELS, WORKERS = 1000, 20, 8, 2
TIMED: Final = ("lease", "heartbeat", "done", "has_open_jobs", "sweep")


@dataclass(frozen=True)
class OverheadRow:
    """`ms_per_job`: wall time of all catalogue calls of the workers; `share`: of their total time."""

    home: str
    jobs: int
    wall_s: float
    ms_per_job: float
    share: float


class TimedCatalogue:
    """Passes all calls on, and sums the time of those that workers make."""

    def __init__(self, catalogue: Any) -> None:
        self._catalogue, self._lock = catalogue, Lock()
        self.seconds: defaultdict[str, float] = defaultdict(float)

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._catalogue, name)
        if name not in TIMED:
            return found

        def timed(*arguments: Any) -> Any:
            begun = time.perf_counter()
            try:
                return found(*arguments)
            finally:
                with self._lock:
                    self.seconds[name] += time.perf_counter() - begun

        return timed


def measure(catalogue_urls: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Measures each catalogue and prints the table."""
    folder = CACHE / f"overhead-{BUILDINGS}-{FILES}"
    town = folder / "town"
    if not town.exists():
        _map3d("make-town", "-o", town, "--buildings", BUILDINGS, "--files", FILES, "--texture-px", 256)
    with new_catalogues(catalogue_urls) as found:
        rows = [_measure_one(name, folder / f"workspace-{time.time_ns()}", new_url(), town) for name, new_url in found.items()]
    table = Table(title=f"the catalogue's share of a render with {WORKERS} workers", title_justify="left")
    for column in ("catalogue", "jobs", "wall s", "ms per job", "share of the workers' time"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(row.home, f"{row.jobs:,}", f"{row.wall_s:.1f}", f"{row.ms_per_job:.1f}", f"{row.share:.2%}")
    Console().print(table)
    return [asdict(row) for row in rows]


def _measure_one(home: str, root: Path, url: str, town: Path) -> OverheadRow:
    os.environ[CATALOGUE_VARIABLE] = url
    where = ("-w", root)
    _map3d("create-scene", "town", *where)
    _map3d("add-files", "town", town, *where)
    _map3d("create-rendering", "town", "view", "--levels", LEVELS, "--view", "0/45", *where)
    workspace = Workspace(root, url)
    catalogue = workspace.open_catalogue()
    timed = TimedCatalogue(catalogue)
    try:
        run = Run(workspace, timed, "view", RunSettings(WORKERS))
        plan = run.plan()
        begun = time.perf_counter()
        result = run.work(plan, lambda _event: None)
        wall_s = time.perf_counter() - begun
    finally:
        catalogue.close()
        del os.environ[CATALOGUE_VARIABLE]
    spent_s, jobs = sum(timed.seconds.values()), result.statistics.done
    return OverheadRow(home, jobs, wall_s, 1000.0 * spent_s / jobs, spent_s / (wall_s * WORKERS))


def _map3d(*words: object) -> None:
    subprocess.run([*MAP3D, *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
