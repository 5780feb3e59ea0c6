"""A worker: a thread that leases one job after another and has its runner do it."""

import threading
import time
from collections.abc import Callable

from map3d.catalogue import Catalogue
from map3d.errors import Map3dError
from map3d.jobs.events import JobFailed, JobOutcome, RunEvent, SceneChanged, WorkerExited
from map3d.jobs.job_runner import JobRunner
from map3d.jobs.open_jobs import has_jobs_left
from map3d.jobs.timeouts import Timeouts
from map3d.messages import verbatim


class JobEnded:
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
    """Runs in its own thread. When `stop` is set it finishes its job and exits."""

    def __init__(
        self, name: str, catalogue: Catalogue, rendering: str, runner: JobRunner, timeouts: Timeouts, stop: threading.Event, job_ended: JobEnded
    ) -> None:
        self.name, self._catalogue, self._rendering, self._runner = name, catalogue, rendering, runner
        self._timeouts, self._stop, self._job_ended = timeouts, stop, job_ended
        self._failed: set[tuple[str, str]] = set()
        self.start = 0
        """Hilbert index from which the worker takes its next base block: blocks of the same ground share chunks and textures."""
        self.idle_since: float | None = None
        """Monotonic seconds; None while the worker has a job or starts a subprocess."""

    def run(self, report: Callable[[RunEvent], None]) -> None:
        """Works until no jobs are left, then reports `WorkerExited`."""
        exited = WorkerExited(self.name)
        try:
            exited = self._work_on(report)
        except Map3dError as error:
            exited = WorkerExited(self.name, error.message)
        except BaseException as error:
            exited = WorkerExited(self.name, verbatim(f"{type(error).__name__}: {error}"), error=error)
        finally:
            self._runner.close()
            report(exited)

    def _work_on(self, report: Callable[[RunEvent], None]) -> WorkerExited:
        while not self._stop.is_set() and self._runner.make_ready(self._stop):
            since = self._job_ended.count
            event = self._work_on_next()
            if event is not None:
                report(event)
                self._job_ended.notify()
            elif not has_jobs_left(self._catalogue, self._rendering):
                break
            else:
                self.idle_since = self.idle_since or time.monotonic()
                self._job_ended.wait(since, self._timeouts.idle_s)
            if isinstance(event, SceneChanged):
                break
            if len(self._failed) >= self._timeouts.failures:
                return WorkerExited(self.name, verbatim(f"failed {len(self._failed)} different jobs"), jobs_failed=True)
        return WorkerExited(self.name)

    def _work_on_next(self) -> JobOutcome | None:
        """Does the next job; returns None when no job is available now."""
        lease = self._catalogue.lease(self._rendering, self.name, self.start)
        if lease is None:
            return None
        self.idle_since = None
        if lease.kind == "base":
            self.start = lease.ground
        event = self._runner.run(lease)
        if isinstance(event, JobFailed):
            self._failed.add((lease.track, str(lease.block)))
        return event
