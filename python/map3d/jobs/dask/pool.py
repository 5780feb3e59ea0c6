"""`map3d render --dask`: has the workers of a Dask cluster do the jobs, one task per job.

A task leases the next job when it starts, so tasks that wait in Dask's queue hold no lease, and it does not matter which of them are lost: the
catalogue says which jobs are left. Dask decides where tasks run, and how many workers there are.
"""

import importlib
import queue
import secrets
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Self

from map3d import __version__
from map3d.catalogue import Catalogue, RenderingRecord, State, Workspace
from map3d.catalogue.catalogue_url import has_password
from map3d.catalogue.open_catalogue import is_networked
from map3d.errors import BadRequest, StoreError
from map3d.jobs.dask import task as dask_task
from map3d.jobs.dask.task import SessionSpec, TaskResult
from map3d.jobs.dead_workers import expire_dead_workers, expire_workers_of
from map3d.jobs.events import Remaining, RunEvent, SceneChanged, Stopping, Waiting, WorkerExited
from map3d.jobs.local_pool import OnEvent
from map3d.jobs.open_jobs import count_open, has_jobs_left
from map3d.jobs.run_settings import RunSettings
from map3d.jobs.run_statistics import RunStatistics
from map3d.jobs.stop_request import StopRequest
from map3d.messages import verbatim
from map3d.tiles.track_stores import tiles_url

TASKS_PER_THREAD: Final = 4
MORE_TASKS: Final = 16
"""At most TASKS_PER_THREAD tasks per thread of the cluster and MORE_TASKS more are in flight. So Dask's adaptive scaling sees work for more workers,
even before there is any, and new workers find tasks."""
ERRORS_PER_WORKER: Final = 3
"""The run ends after this many errors per Dask worker without a job in between."""


@dataclass(frozen=True)
class _TaskEnded:
    """A task's future, done in any way."""

    future: Any


class DaskPools:
    """Implements `PoolRunner` on an existing cluster."""

    def __init__(self, address: str, workspace: Workspace, catalogue: Catalogue, settings: RunSettings, folder: str | None = None) -> None:
        """`folder`: the workspace on the Dask workers, None for the same path as here. Raises BadRequest when there is no scheduler at `address`."""
        self._workspace, self._catalogue, self._settings = workspace, catalogue, settings
        self._folder = folder or str(workspace.root.absolute())
        self._run, self._plans = secrets.token_hex(8), 0
        self._client = _connect(address)

    def __call__(self, record: RenderingRecord, statistics: RunStatistics, stats: Counter[str], stop: StopRequest, on_event: OnEvent) -> bool:
        self._plans += 1
        pool = _DaskPool(self._client, self._catalogue, self._spec(record), statistics, stats)
        return pool.run(stop, on_event)

    def close(self) -> None:
        """Ends the subprocesses on the cluster and the connection; the cluster stays."""
        if self._client.status == "running":
            self._client.run(dask_task.end_sessions, self._run, on_error="ignore")
        self._client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _spec(self, record: RenderingRecord) -> SessionSpec:
        url = self._workspace.find_catalogue_url()
        is_secret = url is not None and has_password(url)
        is_everywhere = url is not None and is_networked(url) and tiles_url(record) is not None
        return SessionSpec(
            run=self._run,
            plan=self._plans,
            version=__version__,
            workspace=self._folder,
            catalogue=None if is_secret else url,
            from_environment=is_secret,
            boot=None if is_everywhere else dask_task.kernel_boot(),
            rendering=record.name,
            cache_bytes=self._settings.cache_bytes,
            entry=self._settings.entry,
            timeouts=self._settings.timeouts,
            lease_s=self._catalogue.lease_s,
        )


class _DaskPool:
    """The tasks of one rendering and plan."""

    def __init__(self, client: Any, catalogue: Catalogue, spec: SessionSpec, statistics: RunStatistics, stats: Counter[str]) -> None:
        self._client, self._catalogue, self._spec = client, catalogue, spec
        self._statistics, self._stats = statistics, stats
        self._events: queue.SimpleQueue[_TaskEnded | Stopping] = queue.SimpleQueue()
        self._tasks: set[Any] = set()
        self._nodes = _Nodes(client)
        self._ready_jobs, self._counted_s = 0, 0.0
        self._idle_since_s: float | None = None
        self._is_ending = self._scene_changed = self._waiting_reported = False
        self._errors, self._reported_errors = 0, set[str]()

    def run(self, stop: StopRequest, on_event: OnEvent) -> bool:
        expire_dead_workers(self._catalogue, self._spec.rendering)
        with stop.heard_by(self._events.put):
            self._is_ending = stop.is_made
            while self._has_more():
                self._release_leases_of_lost_nodes()
                self._count(on_event)
                self._submit()
                self._handle_next(on_event)
        return self._scene_changed

    def _has_more(self) -> bool:
        return bool(self._tasks) or not (self._is_ending or not has_jobs_left(self._catalogue, self._spec.rendering))

    def _release_leases_of_lost_nodes(self) -> None:
        lost = self._nodes.update()
        if lost:
            expire_workers_of(self._catalogue, self._spec.rendering, lost)

    def _count(self, on_event: OnEvent) -> None:
        """Estimates the jobs that no task in flight will take."""
        now, timeouts = time.monotonic(), self._spec.timeouts
        if now - self._counted_s < (timeouts.idle_s if len(self._tasks) < self._nodes.threads else timeouts.count_s):
            return
        counts = self._catalogue.count_jobs(self._spec.rendering)
        queued = max(len(self._tasks) - counts[State.LEASED], 0)
        self._ready_jobs, self._counted_s = counts[State.TODO] - queued, now
        on_event(Remaining(count_open(self._catalogue, self._spec.rendering)))
        self._report_waiting(counts[State.LEASED], on_event)

    def _report_waiting(self, leased: int, on_event: OnEvent) -> None:
        """Reports `Waiting` once, when there has been no task for long enough."""
        now = time.monotonic()
        self._idle_since_s = None if self._tasks else self._idle_since_s or now
        if not self._waiting_reported and self._idle_since_s is not None and now - self._idle_since_s >= self._spec.timeouts.wait_s:
            self._waiting_reported = True
            on_event(Waiting(leased))

    def _submit(self) -> None:
        if self._is_ending:
            return
        limit = TASKS_PER_THREAD * self._nodes.threads + MORE_TASKS
        for _ in range(min(limit - len(self._tasks), self._ready_jobs)):
            self._ready_jobs -= 1
            future = self._client.submit(dask_task.run_next_job, self._spec, key=f"map3d-block-{secrets.token_hex(8)}", pure=False, retries=0)
            self._tasks.add(future)
            future.add_done_callback(lambda done: self._events.put(_TaskEnded(done)))

    def _handle_next(self, on_event: OnEvent) -> None:
        try:
            event = self._events.get(timeout=self._spec.timeouts.tick_s)
        except queue.Empty:
            self._check_connection()
            return
        if isinstance(event, Stopping):
            self._end(dask_task.release_jobs if event.at_once else dask_task.drain)
            on_event(event)
        elif event.future in self._tasks:
            self._tasks.discard(event.future)
            result = _result_of(event.future)
            if result is not None:
                self._handle(result, on_event)

    def _handle(self, result: TaskResult, on_event: OnEvent) -> None:
        if result.error is not None:
            self._handle_error(result.process, result.error, on_event)
        elif result.outcome is not None:
            self._errors = 0
            self._stats.update(result.stats)
            self._report(result.outcome, on_event)
            if isinstance(result.outcome, SceneChanged):
                self._scene_changed = True
                self._end(dask_task.drain)

    def _handle_error(self, process: str, error: str, on_event: OnEvent) -> None:
        """Reports the first error of each Dask worker. Ends the run when none of the workers can work."""
        self._errors += 1
        if process not in self._reported_errors:
            self._reported_errors.add(process)
            self._report(WorkerExited(process, verbatim(error)), on_event)
        if self._errors >= ERRORS_PER_WORKER * max(self._nodes.count, 1):
            self._end(dask_task.drain)

    def _report(self, event: RunEvent, on_event: OnEvent) -> None:
        self._statistics.add(event)
        on_event(event)

    def _end(self, on_workers: Callable[[str], None]) -> None:
        """Submits no more tasks, and informs the workers."""
        self._is_ending = True
        self._client.run(on_workers, self._spec.run, on_error="ignore")

    def _check_connection(self) -> None:
        if self._client.status != "running":
            raise StoreError(
                f"lost the connection to the Dask scheduler ({self._client.status}); committed blocks are kept: "
                f"run map3d render {self._spec.rendering} again when the scheduler is back"
            )


class _Nodes:
    """The workers of the cluster, as the scheduler lists them once a second."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._threads: dict[str, int] = {}
        self._processes: dict[str, str] = {}
        self._listed_s = 0.0

    @property
    def threads(self) -> int:
        return sum(self._threads.values())

    @property
    def count(self) -> int:
        return len(self._threads)

    def update(self) -> set[str]:
        """Returns the processes of the workers that the scheduler has lost since the last update."""
        now = time.monotonic()
        if now - self._listed_s < 1.0:
            return set()
        self._listed_s, self._threads = now, dict(self._client.nthreads())
        lost = {self._processes.pop(address) for address in list(self._processes) if address not in self._threads}
        added = [address for address in self._threads if address not in self._processes]
        if added:
            self._processes |= self._client.run(dask_task.process_name, workers=added, on_error="ignore")
        return lost


def _connect(address: str) -> Any:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise BadRequest("--dask needs the Python package distributed; install it with pip install 'map3d[dask]'") from error
    try:
        return distributed.Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise BadRequest(f"cannot connect to a Dask scheduler at {address} ({error}); give its address as in tcp://HOST:8786") from error


def _result_of(future: Any) -> TaskResult | None:
    """Returns None when the task was lost, as with a killed worker: its job is leased again once the lease has ended."""
    if future.status != "finished":
        return None
    result: TaskResult = future.result()
    return result
