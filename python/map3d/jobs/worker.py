"""A worker: leases one job after another, has its subprocess do it and commits the result (spec/catalogue.md).

Commit of a block: the subprocess renders it → checks → `commit` (one transaction of the tile store, with the fence) →
`done` with the fence.
"""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

from map3d.catalogue import Catalogue, JobResult, Lease
from map3d.errors import Map3dError, StaleFence, StalePlan, Stopped, SubprocessStartFailed
from map3d.jobs.events import JobDone, JobFailed, LeaseLost, RunEvent, SceneChanged, WorkerExited
from map3d.jobs.timeouts import Timeouts
from map3d.subprocess import Failure, Message, Subprocess
from map3d.tiles.naming import morton


class Task(Protocol):
    """The work of a job; a worker itself deals only with leases and subprocesses."""

    def start_subprocess(self) -> Subprocess: ...

    def request(self, lease: Lease) -> Message:
        """Returns the request for the subprocess."""

    def commit(self, lease: Lease, response: Message) -> JobResult:
        """Checks and stores the response; it is durable on return."""


class Signal:
    """Wakes idle workers when a job has ended, since that may have opened another one."""

    def __init__(self) -> None:
        self._changed, self._count = threading.Condition(), 0

    @property
    def count(self) -> int:
        return self._count

    def notify(self) -> None:
        with self._changed:
            self._count += 1
            self._changed.notify_all()

    def wait(self, since: int, timeout_s: float) -> None:
        """Waits until `count` differs from `since`."""
        with self._changed:
            self._changed.wait_for(lambda: self._count != since, timeout_s)


class Worker:
    """Runs in its own thread. When `stop` is set it finishes its job and exits; when `stop_now` is set it releases its job and exits."""

    def __init__(
        self,
        name: str,
        catalogue: Catalogue,
        rendering: str,
        task: Task,
        timeouts: Timeouts,
        stop: threading.Event,
        stop_now: threading.Event,
        job_ended: Signal,
    ) -> None:
        self.name, self._job_ended = name, job_ended
        self._catalogue, self._rendering, self._task, self._timeouts = catalogue, rendering, task, timeouts
        self._stop, self._stop_now = stop, stop_now
        self._subprocess: Subprocess | None = None
        self._failed: set[tuple[str, str]] = set()
        self.start = 0
        """Morton number from which the worker takes its next base block: neighbours share chunks and textures."""
        self.idle_since: float | None = None
        """Monotonic seconds; None while the worker has a job or starts a subprocess."""

    def run(self, report: Callable[[RunEvent], None]) -> None:
        """Works until no jobs are left, then reports `WorkerExited`."""
        exited = WorkerExited(self.name)
        try:
            exited = self._work_on(report)
        except Map3dError as error:
            exited = WorkerExited(self.name, str(error))
        except BaseException as error:
            exited = WorkerExited(self.name, f"{type(error).__name__}: {error}", error=error)
        finally:
            self._end_subprocess()
            report(exited)

    def _work_on(self, report: Callable[[RunEvent], None]) -> WorkerExited:
        while not self._stop.is_set():
            process = self._ready_subprocess()
            if process is None:
                break
            since = self._job_ended.count
            lease = self._catalogue.lease(self._rendering, self.name, self.start)
            if lease is not None:
                self.idle_since = None
                if lease.kind == "base":
                    self.start = morton(lease.block.x, lease.block.y)
                event = self._work(process, lease)
                report(event)
                self._job_ended.notify()
                if isinstance(event, SceneChanged):
                    break
            elif self._no_jobs_left():
                break
            else:
                self.idle_since = self.idle_since or time.monotonic()
                self._job_ended.wait(since, self._timeouts.idle_s)
            if len(self._failed) >= self._timeouts.failures:
                return WorkerExited(self.name, f"failed {len(self._failed)} different jobs", jobs_failed=True)
        return WorkerExited(self.name)

    def _no_jobs_left(self) -> bool:
        """Sweeps before it gives up, since a killed process may have left reduce jobs waiting."""
        return not self._catalogue.has_open_jobs(self._rendering) and self._catalogue.sweep(self._rendering) == 0

    def _work(self, process: Subprocess, lease: Lease) -> RunEvent:
        heartbeat = _Heartbeat(self._catalogue, lease, self._timeouts, self._stop_now)
        try:
            response = process.request(
                self._task.request(lease), wall_s=self._timeouts.block_s, every_s=self._timeouts.tick_s, on_progress=heartbeat.on_progress
            )
            if isinstance(response, Failure) and response.kind == StalePlan.__name__:
                self._catalogue.release(lease)
                return SceneChanged(lease, response.message)
            if isinstance(response, Failure):
                return self._fail(lease, f"{response.kind}: {response.message}")
            with heartbeat.continued():
                result = self._task.commit(lease, response)
            self._catalogue.done(lease, result)
            return JobDone(lease, result)
        except StaleFence as error:
            self._end_subprocess()
            return LeaseLost(lease, str(error))
        except Stopped as error:
            self._end_subprocess()
            return self._release(lease, str(error))
        except Map3dError as error:
            self._end_subprocess()
            return self._fail(lease, str(error))

    def _release(self, lease: Lease, reason: str) -> RunEvent:
        try:
            self._catalogue.release(lease)
        except StaleFence as error:
            return LeaseLost(lease, f"{reason}; {error}")
        return LeaseLost(lease, reason)

    def _fail(self, lease: Lease, reason: str) -> RunEvent:
        try:
            state = self._catalogue.fail(lease, reason)
        except StaleFence as error:
            return LeaseLost(lease, f"{reason}; {error}")
        self._failed.add((lease.track, str(lease.block)))
        return JobFailed(lease, reason, state)

    def _ready_subprocess(self) -> Subprocess | None:
        """Returns None when stopped meanwhile. Raises SubprocessStartFailed, or SubprocessDied after too many attempts."""
        for attempt in range(1, self._timeouts.starts + 1):
            if self._subprocess is not None:
                return self._subprocess
            try:
                self._subprocess = self._task.start_subprocess()
                self._subprocess.wait_ready(self._timeouts.start_s)
            except Map3dError as error:
                self._end_subprocess()
                if isinstance(error, SubprocessStartFailed) or attempt == self._timeouts.starts:
                    raise
                if self._stop.wait(self._timeouts.start_pause_s * attempt):
                    return None
        return self._subprocess

    def _end_subprocess(self) -> None:
        if self._subprocess is not None:
            self._subprocess.close()
            self._subprocess = None


class _Heartbeat:
    """Renews a lease while the subprocess works and while the block is committed."""

    def __init__(self, catalogue: Catalogue, lease: Lease, timeouts: Timeouts, stop_now: threading.Event) -> None:
        self._catalogue, self._lease, self._timeouts, self._stop_now = catalogue, lease, timeouts, stop_now
        self._renewed_s = time.monotonic()

    def on_progress(self, _progress: object) -> None:
        """Raises Stopped when the user stops the run at once, StaleFence when the lease is lost."""
        if self._stop_now.is_set():
            raise Stopped("stopped by the user")
        if time.monotonic() - self._renewed_s >= self._timeouts.heartbeat_s:
            self.renew()

    @contextmanager
    def continued(self) -> Iterator[None]:
        """Renews the lease now, and from a thread of its own while the context lasts. Raises StaleFence when the lease is lost at the start; if it is
        lost later, the store and the catalogue refuse the fence."""
        self.renew()
        over = threading.Event()
        thread = threading.Thread(target=self._renew_until, args=(over,), name=f"heartbeat of {self._lease.worker}")
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _renew_until(self, over: threading.Event) -> None:
        with suppress(Map3dError):
            while not over.wait(self._timeouts.heartbeat_s):
                self.renew()

    def renew(self) -> None:
        self._catalogue.heartbeat(self._lease)
        self._renewed_s = time.monotonic()
