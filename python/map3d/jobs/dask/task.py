"""The side of a Dask worker: a task leases the next job, does it and commits it. The worker keeps a subprocess between tasks.

Nothing here imports Dask: a task is a plain function that the Dask worker calls in one of its threads.
"""

import os
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from map3d import __version__
from map3d.catalogue import Workspace
from map3d.catalogue.workspace import CATALOGUE_VARIABLE
from map3d.errors import BadRequest, Map3dError
from map3d.jobs.dead_workers import expire_dead_workers, worker_name
from map3d.jobs.events import JobOutcome, SceneChanged
from map3d.jobs.job_runner import JobRunner
from map3d.jobs.timeouts import Timeouts
from map3d.process_identity import ProcessIdentity
from map3d.renderings.render_task import RenderTask

IDLE_S: Final = 120.0
"""A Dask worker that gets no task for this long, such as one whose client was killed, ends its subprocesses."""
ERROR_PAUSE_S: Final = 1.0
"""Pause of a task on a node that cannot work, which would else take all tasks and fail them."""


@dataclass(frozen=True)
class SessionSpec:
    """What a Dask worker needs to take part in a run. `plan` counts the plans of the run: each has its own record of the rendering. `workspace`: the
    folder on the Dask worker. `catalogue`: URL without a password; None for the SQLite file in the workspace, or with `from_environment` for the URL
    in the environment of the Dask worker. `boot`: of the only machine that has the catalogue and the tiles, None if all can open them."""

    run: str
    plan: int
    version: str
    workspace: str
    catalogue: str | None
    from_environment: bool
    boot: str | None
    rendering: str
    cache_bytes: int
    entry: str
    timeouts: Timeouts
    lease_s: float


@dataclass(frozen=True)
class TaskResult:
    """`process`: of the Dask worker; `outcome`: None when no job was available; `error`: why this Dask worker could not try one."""

    process: str
    outcome: JobOutcome | None = None
    stats: Mapping[str, float] = field(default_factory=dict)
    error: str | None = None


def run_next_job(spec: SessionSpec) -> TaskResult:
    """Does the next job of the rendering. Returns a Map3dError instead of raising it: the node is at fault, and Dask would blame the task."""
    process = process_name()
    try:
        _check_node(spec)
        with _sessions.use(spec) as session:
            return session.run_next_job()
    except Map3dError as error:
        time.sleep(ERROR_PAUSE_S)
        return TaskResult(process, error=str(error))


def process_name() -> str:
    """Returns the name of this process, with which the names of its workers begin."""
    return str(ProcessIdentity.current())


def kernel_boot() -> str:
    """Returns a name of the running kernel, which all processes of a machine share."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        return ProcessIdentity.current().host


def drain(run: str) -> None:
    """Lets the tasks of a run that have not begun end without a job."""
    _sessions.drained.add(run)


def release_jobs(run: str) -> None:
    """Makes the tasks of a run release their jobs and end."""
    drain(run)
    for session in _sessions.of(run):
        session.stop_now.set()


def end_sessions(run: str) -> None:
    """Ends the subprocesses of a run."""
    for session in _sessions.of(run):
        _sessions.end(session)


def _check_node(spec: SessionSpec) -> None:
    if spec.version != __version__:
        raise BadRequest(f"this Dask worker has map3d {__version__}, the run has {spec.version}; install the same version on all nodes")
    if spec.boot not in (None, kernel_boot()):
        raise BadRequest(
            f"this Dask worker is on another machine ({ProcessIdentity.current().host}), and SQLite files serve one machine only; "
            "use a MongoDB catalogue (MAP3D_CATALOGUE) and create-rendering --tiles URL, see docs/nodes.md"
        )
    if spec.from_environment and not os.environ.get(CATALOGUE_VARIABLE):
        raise BadRequest(
            f"the environment of this Dask worker on {ProcessIdentity.current().host} has no {CATALOGUE_VARIABLE}; "
            "set it there to the catalogue's URL, since its password is not sent"
        )


class _Session:
    """One run's catalogue, task and runners in this process; every thread has its own runner."""

    def __init__(self, spec: SessionSpec) -> None:
        self.spec, self.stop_now = spec, threading.Event()
        self.users, self.used_s = 0, time.monotonic()
        self._lock = threading.Lock()
        self._runners: dict[int, _ThreadRunner] = {}
        workspace = Workspace(Path(spec.workspace), spec.catalogue)
        self._catalogue = workspace.open_catalogue(lease_s=spec.lease_s)
        try:
            expire_dead_workers(self._catalogue, spec.rendering)
            record = self._catalogue.rendering(spec.rendering)
            self._scene = record.scene
            self._task = RenderTask(workspace, record, cache_bytes=spec.cache_bytes, entry=spec.entry, scene=self._catalogue.scene(record.scene))
        except BaseException:
            self._catalogue.close()
            raise

    def run_next_job(self) -> TaskResult:
        own, process = self._runner_of_thread(), process_name()
        if self.spec.run in _sessions.drained or not own.runner.make_ready(self.stop_now):
            return TaskResult(process)
        lease = self._catalogue.lease(self.spec.rendering, own.name, own.start)
        if lease is None:
            return TaskResult(process)
        if lease.kind == "base":
            own.start = lease.ground
        event = own.runner.run(lease)
        if isinstance(event, SceneChanged):
            self._task.update_scene(self._catalogue.scene(self._scene))
        return TaskResult(process, event, self._task.take_stats())

    def _runner_of_thread(self) -> "_ThreadRunner":
        with self._lock:
            number = threading.get_ident()
            if number not in self._runners:
                runner = JobRunner(self._catalogue, self._task, self.spec.timeouts, self.stop_now)
                self._runners[number] = _ThreadRunner(worker_name(len(self._runners) + 1), runner)
            return self._runners[number]

    def close(self) -> None:
        for own in self._runners.values():
            own.runner.close()
        self._task.close()
        self._catalogue.close()


@dataclass
class _ThreadRunner:
    name: str
    runner: JobRunner
    start: int = 0


class _Sessions:
    """The open sessions of this process. A session without tasks for IDLE_S is closed, so that a killed client leaves no subprocess behind."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: dict[SessionSpec, _Session] = {}
        self._ending: set[_Session] = set()
        self._watch: threading.Thread | None = None
        self.drained: set[str] = set()

    @contextmanager
    def use(self, spec: SessionSpec) -> Iterator[_Session]:
        """Opens the session on first use, and ends those of earlier plans."""
        with self._lock:
            if spec not in self._open:
                self._open[spec] = _Session(spec)
                self._start_watch()
            session = self._open[spec]
            session.users += 1
        for older in self.of(spec.run):
            if older.spec.plan < spec.plan:
                self.end(older)
        try:
            yield session
        finally:
            with self._lock:
                session.users -= 1
                session.used_s = time.monotonic()
                is_over = session in self._ending and not session.users
                self._ending -= {session} if is_over else set()
            if is_over:
                session.close()

    def of(self, run: str) -> list[_Session]:
        with self._lock:
            return [session for session in self._open.values() if session.spec.run == run]

    def end(self, session: _Session, *, idle_s: float | None = None) -> None:
        """Closes the session, now or after its last task; with `idle_s` only if it has had no task for this time."""
        with self._lock:
            if idle_s is not None and (session.users or time.monotonic() - session.used_s < idle_s):
                return
            closes_now = self._open.pop(session.spec, None) is session and not session.users
            if session.users:
                self._ending.add(session)
        if closes_now:
            session.close()

    def _start_watch(self) -> None:
        if self._watch is None or not self._watch.is_alive():
            self._watch = threading.Thread(target=self._end_idle, name="map3d idle sessions", daemon=True)
            self._watch.start()

    def _end_idle(self) -> None:
        while True:
            time.sleep(IDLE_S / 8)
            for session in list(self._open.values()):
                self.end(session, idle_s=IDLE_S)


_sessions: Final = _Sessions()
