"""Makes every system call of the commit path fail once: lease, heartbeat, `put_block`, `done`. Uses strace's fault injection.

After each fault, nothing may be half committed: the stores are sound, a done job has its block, and the same commit, tried again, gives the same
tiles as without a fault.
"""

import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

from map3d.catalogue import State, Workspace
from map3d.renderings.plan import plan_jobs
from map3d.renderings.render_task import RenderTask
from map3d.scenes.build import open_scene
from map3d.subprocess import Message
from map3d.tiles.sqlite_store import SqliteTileStore
from tests.faults.commit_one import WORKER
from tests.faults.street import RENDERING, SCENE, make_workspace

FAULTS: Final = {
    "pwrite64": ("error=EIO", "error=ENOSPC", "signal=KILL", "error=EIO:signal=KILL"),
    "write": ("error=EIO", "error=ENOSPC", "signal=KILL"),
    "pread64": ("error=EIO",),
    "fdatasync": ("error=EIO", "signal=KILL"),
    "fsync": ("error=EIO", "signal=KILL"),
    "ftruncate": ("error=EIO", "error=ENOSPC", "signal=KILL"),
    "fallocate": ("error=ENOSPC", "signal=KILL"),
    "openat": ("error=EACCES", "error=EMFILE"),
    "mmap": ("error=ENOMEM",),
    "unlink": ("error=EIO", "signal=KILL"),
    "rename": ("error=EIO", "signal=KILL"),
    "link": ("error=EIO", "signal=KILL"),
    "fcntl": ("error=EIO",),
}
"""`signal=KILL`: the call succeeds and the process ends; with an error: it ends before the call had an effect."""
TRACE_S: Final = 120


class Point(NamedTuple):
    """The `number`th call of `call` fails."""

    call: str
    number: int
    fault: str


@dataclass
class CallReport:
    """`outcomes`: number of points by what the process did."""

    outcomes: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)


class CommitTrial:
    """A workspace in which one job is to be committed, and its rendered response."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.template = folder / "template"
        workspace = make_workspace(self.template, houses=3)
        self._response = folder / "response"
        self._response.write_bytes(pickle.dumps(_render_first(workspace)))
        self._expected = self._tiles_after(self._copy())

    def points(self) -> Iterator[Point]:
        """Yields every call on the databases of an undisturbed commit, with every fault."""
        root, log = self._copy(), self._folder / "calls"
        self._trace(root, ["-e", "trace=" + ",".join(FAULTS)], log)
        calls = Counter(re.findall(r"^\d+ +(\w+)\(", log.read_text(), re.MULTILINE))
        for call, faults in FAULTS.items():
            for number in range(1, calls[call] + 1):
                yield from (Point(call, number, fault) for fault in faults)

    def fail(self, point: Point, report: CallReport) -> None:
        root = self._copy()
        inject = f"inject={point.call}:{point.fault}:when={point.number}"
        done = self._trace(root, ["-e", f"trace={point.call}", "-e", inject], Path(os.devnull))
        outcome = {0: "succeeded", 3: "failed with a clear error", -9: "killed", 137: "killed"}.get(done.returncode)
        report.outcomes[outcome or "other"] += 1
        if outcome is None:
            report.faults.append(f"{point}: status {done.returncode}: {done.stderr[-300:]}")
        report.faults += [f"{point}: {fault}" for fault in self._half_committed(root)]
        if (tiles := self._tiles_after(root)) != self._expected:
            report.faults.append(f"{point}: tried again, the commit gives {len(tiles)} other tiles")

    def _copy(self) -> Path:
        root = self._folder / "trial"
        shutil.rmtree(root, ignore_errors=True)
        shutil.copytree(self.template, root)
        return root

    def _trace(self, root: Path, options: list[str], log: Path) -> subprocess.CompletedProcess[str]:
        names = [root / "catalogue.sqlite", *(path for path in _store_paths(root))]
        watched = [part for name in names for suffix in ("", "-wal", "-shm") for part in ("-P", f"{name}{suffix}")]
        command = ["strace", "-f", "-qq", "-o", str(log), *watched, *options, *_commit_command(root, self._response)]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=TRACE_S)

    def _tiles_after(self, root: Path) -> list[tuple[int, ...]]:
        """Commits without faults, unless the job is done, and returns the stored tiles."""
        if _job_state(root) is not State.DONE:
            _expire_lease(root)
            subprocess.run(_commit_command(root, self._response), check=True, timeout=TRACE_S)
        return _stored(root)

    def _half_committed(self, root: Path) -> Iterator[str]:
        """Yields what is wrong in the databases after a fault."""
        stored = _stored(root)
        if stored and stored != self._expected:
            yield f"{len(stored)} tiles of a part of the block are visible"
        if _job_state(root) is State.DONE and not stored:
            yield "the job is done, its tiles are missing"


def run_system_calls(every: int = 1, show: bool = True) -> CallReport:
    """Makes every call fail once with every fault, or every `every`th of these points."""
    report = CallReport()
    with tempfile.TemporaryDirectory(prefix="map3d-calls-") as folder:
        trial = CommitTrial(Path(folder))
        points = list(trial.points())[::every]
        for number, point in enumerate(points):
            trial.fail(point, report)
            if show and number % 50 == 49:
                print(f"{number + 1} of {len(points)} points: {dict(report.outcomes)}, {len(report.faults)} faults", flush=True)
    return report


def is_strace_usable() -> bool:
    """Whether strace is installed and may trace a process."""
    return (
        bool(shutil.which("strace")) and subprocess.run(["strace", "-qq", "-o", os.devnull, "true"], check=False, capture_output=True).returncode == 0
    )


def _commit_command(root: Path, response: Path) -> list[str]:
    return [sys.executable, "-m", "tests.faults.commit_one", str(root), str(response)]


def _render_first(workspace: Workspace) -> Message:
    """Plans one base block and the block above it, and returns the rendered base block."""
    catalogue = workspace.open_catalogue()
    record = catalogue.rendering(RENDERING)
    jobs = list(plan_jobs(open_scene(workspace, SCENE), record, {}))
    catalogue.plan(RENDERING, [jobs[0], next(job for job in jobs if job.block == jobs[0].parent)])
    task = RenderTask(workspace, record)
    lease = catalogue.lease(RENDERING, "first")
    assert lease is not None
    process = task.start_subprocess()
    process.wait_ready(60)
    response = process.request(task.request(lease), wall_s=60)
    process.close()
    assert isinstance(response, Message), response
    catalogue.release(lease)
    task.close()
    catalogue.close()
    return response


def _job_state(root: Path) -> State:
    catalogue = Workspace(root).open_catalogue()
    (job,) = [job for job in catalogue.jobs(RENDERING) if job.kind == "base"]
    catalogue.close()
    return job.state


def _expire_lease(root: Path) -> None:
    catalogue = Workspace(root).open_catalogue()
    catalogue.expire(RENDERING, [WORKER])
    catalogue.close()


def _store_paths(root: Path) -> list[Path]:
    return sorted((root / "renderings" / RENDERING).glob("*.sqlite"))


def _stored(root: Path) -> list[tuple[int, ...]]:
    """Returns the tiles of all stores with the CRC of their bytes; raises AssertionError for an unsound store."""
    tiles: list[tuple[int, ...]] = []
    for path in _store_paths(root):
        with SqliteTileStore(path, read_only=True) as store:
            assert store.check() == [], store.check()
            for layer in range(len(store.shape.layers)):
                tiles += [(layer, *tile, zlib.crc32(store.get_tile(layer, *tile) or b"")) for tile in store.list_tiles(layer)]
    return tiles
