"""Does leased jobs: has a subprocess do one after another, renews the lease and commits the result (spec/catalogue.md).

Commit of a block: the subprocess renders it → checks → `commit` (one transaction of the tile store, with the fence) →
`done` with the fence.
"""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

from map3d.catalogue import Catalogue, JobResult, Lease
from map3d.errors import Map3dError, StaleFence, StalePlan, Stopped, SubprocessStartFailed
from map3d.jobs.events import JobDone, JobFailed, JobOutcome, LeaseLost, SceneChanged
from map3d.jobs.timeouts import Timeouts
from map3d.messages import Message as Reason
from map3d.messages import message, verbatim
from map3d.subprocess import Failure, Message, Subprocess


class Task(Protocol):
    """The work of a job; a runner itself deals only with leases and subprocesses."""

    def start_subprocess(self) -> Subprocess: ...

    def request(self, lease: Lease) -> Message:
        """Returns the request for the subprocess."""

    def commit(self, lease: Lease, response: Message) -> JobResult:
        """Checks and stores the response; it is durable on return."""


class JobRunner:
    """Keeps one subprocess, which it replaces after it has died. Belongs to one thread, since the subprocess dies with the thread that started it."""

    def __init__(self, catalogue: Catalogue, task: Task, timeouts: Timeouts, stop_now: threading.Event) -> None:
        self._catalogue, self._task, self._timeouts, self._stop_now = catalogue, task, timeouts, stop_now
        self._subprocess: Subprocess | None = None

    def make_ready(self, stop: threading.Event) -> bool:
        """Starts the subprocess unless it runs; returns False when `stop` is set meanwhile. Raises SubprocessStartFailed, or SubprocessDied after too
        many attempts."""
        for attempt in range(1, self._timeouts.starts + 1):
            if self._subprocess is not None:
                return True
            try:
                self._subprocess = self._task.start_subprocess()
                self._subprocess.wait_ready(self._timeouts.start_s)
            except Map3dError as error:
                self.close()
                if isinstance(error, SubprocessStartFailed) or attempt == self._timeouts.starts:
                    raise
                if stop.wait(self._timeouts.start_pause_s * attempt):
                    return False
        return self._subprocess is not None

    def run(self, lease: Lease) -> JobOutcome:
        """Does the leased job; its subprocess must be ready."""
        assert self._subprocess is not None, "make_ready comes first"
        heartbeat = _Heartbeat(self._catalogue, lease, self._timeouts, self._stop_now)
        try:
            response = self._subprocess.request(
                self._task.request(lease), wall_s=self._timeouts.block_s, every_s=self._timeouts.tick_s, on_progress=heartbeat.on_progress
            )
            if isinstance(response, Failure) and response.kind == StalePlan.__name__:
                self._catalogue.release(lease)
                return SceneChanged(lease, response.message)
            if isinstance(response, Failure):
                return self._fail(lease, message("about", what=response.kind, message=response.message))
            with heartbeat.continued():
                result = self._task.commit(lease, response)
            self._catalogue.done(lease, result)
            return JobDone(lease, result)
        except StaleFence as error:
            self.close()
            return LeaseLost(lease, error.message)
        except Stopped as error:
            self.close()
            return self._release(lease, error.message)
        except Map3dError as error:
            self.close()
            return self._fail(lease, error.message)

    def _release(self, lease: Lease, reason: Reason) -> JobOutcome:
        try:
            self._catalogue.release(lease)
        except StaleFence as error:
            return LeaseLost(lease, verbatim(f"{reason}; {error}"))
        return LeaseLost(lease, reason)

    def _fail(self, lease: Lease, reason: Reason) -> JobOutcome:
        try:
            state = self._catalogue.fail(lease, reason)
        except StaleFence as error:
            return LeaseLost(lease, verbatim(f"{reason}; {error}"))
        return JobFailed(lease, reason, state)

    def close(self) -> None:
        """Ends the subprocess; `make_ready` starts another one."""
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
