"""The workers of one process for one rendering: one thread and one subprocess each."""

import queue
import threading
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from map3d.catalogue import Catalogue, State
from map3d.jobs.dead_workers import expire_dead_workers, worker_name
from map3d.jobs.events import Remaining, RunEvent, SceneChanged, Stopping, Waiting, WorkerExited
from map3d.jobs.job_runner import JobRunner, Task
from map3d.jobs.open_jobs import count_open
from map3d.jobs.run_statistics import RunStatistics
from map3d.jobs.stop_request import StopRequest
from map3d.jobs.timeouts import Timeouts
from map3d.jobs.worker import JobEnded, Worker

_POLL_S = 0.2


class WorkerPool(Protocol):
    """Does the jobs of one rendering until none are left or the user stops it."""

    scene_changed: bool
    """The plan is stale: the pool has stopped after the current jobs, and the rendering has to be planned again."""

    def run(self, on_event: Callable[[RunEvent], None]) -> RunStatistics:
        """Blocks until the last worker exits, and calls `on_event` in this thread."""


class Pool:
    """Implements `WorkerPool` with `size` workers in threads of this process.

    Replaces a worker that exited because of failed jobs as long as the run completes any job: then the jobs are at fault, not the machine.
    """

    def __init__(
        self, catalogue: Catalogue, rendering: str, task: Task, size: int, timeouts: Timeouts | None = None, stop: StopRequest | None = None
    ) -> None:
        self._catalogue, self._rendering, self._task, self._timeouts = catalogue, rendering, task, timeouts or Timeouts()
        self._size, self.stop = size, stop or StopRequest()
        self._events: queue.SimpleQueue[RunEvent] = queue.SimpleQueue()
        self._stop, self._stop_now, self._job_ended = threading.Event(), threading.Event(), JobEnded()
        self._threads: dict[str, threading.Thread] = {}
        self._workers: dict[str, Worker] = {}
        self._started = 0
        self._waiting_reported = False
        self._freed_s = 0.0
        self._counted_s = time.monotonic()
        self.scene_changed = False
        self._ground: NDArray[np.int64] = np.zeros(0, np.int64)
        self._error: BaseException | None = None
        self.statistics = RunStatistics()

    def run(self, on_event: Callable[[RunEvent], None]) -> RunStatistics:
        expire_dead_workers(self._catalogue, self._rendering)
        self._ground = self._open_ground()
        with self.stop.heard_by(self._events.put):
            for _ in range(0 if self.stop.is_made else self._size):
                self._start_worker()
            while self._threads or not self._events.empty():
                self._handle_next(on_event)
        if self._error is not None:
            raise self._error
        return self.statistics

    def _open_ground(self) -> NDArray[np.int64]:
        """Returns the Hilbert indices of the base blocks to do, of all views together, in ascending order."""
        jobs = self._catalogue.jobs(self._rendering, state=State.TODO)
        return np.sort(np.fromiter((job.ground for job in jobs if job.kind == "base"), np.int64))

    def _handle_next(self, on_event: Callable[[RunEvent], None]) -> None:
        self._report_remaining(on_event)
        try:
            event = self._events.get(timeout=_POLL_S)
        except queue.Empty:
            self._wait_for_others(on_event)
            return
        self.statistics.add(event)
        if isinstance(event, Stopping):
            self._let_workers_exit(at_once=event.at_once)
        elif isinstance(event, SceneChanged):
            self.scene_changed = True
            self._let_workers_exit()
        elif isinstance(event, WorkerExited):
            self._error = self._error or event.error
            self._threads.pop(event.worker).join()
            del self._workers[event.worker]
            if event.jobs_failed and self.statistics.done and not self._stop.is_set():
                self._start_worker()
        on_event(event)

    def _let_workers_exit(self, at_once: bool = False) -> None:
        if at_once:
            self._stop_now.set()
        self._stop.set()
        self._job_ended.notify()

    def _report_remaining(self, on_event: Callable[[RunEvent], None]) -> None:
        """Reports `Remaining` once per `count_s`."""
        now = time.monotonic()
        if now - self._counted_s >= self._timeouts.count_s:
            self._counted_s = now
            on_event(Remaining(count_open(self._catalogue, self._rendering)))

    def _wait_for_others(self, on_event: Callable[[RunEvent], None]) -> None:
        """While all workers are idle: frees the leases of processes that have ended meanwhile, every `wait_s`, and reports `Waiting` once."""
        now = time.monotonic()
        idle = [worker.idle_since for worker in self._workers.values()]
        if not idle or any(since is None or since > now - self._timeouts.wait_s for since in idle) or now - self._freed_s < self._timeouts.wait_s:
            return
        self._freed_s = now
        if expire_dead_workers(self._catalogue, self._rendering):
            self._job_ended.notify()
        elif not self._waiting_reported:
            self._waiting_reported = True
            on_event(Waiting(self._catalogue.count_jobs(self._rendering)[State.LEASED]))

    def _start_worker(self) -> None:
        self._started += 1
        name = worker_name(self._started)
        runner = JobRunner(self._catalogue, self._task, self._timeouts, self._stop_now)
        worker = Worker(name, self._catalogue, self._rendering, runner, self._timeouts, self._stop, self._job_ended)
        if len(self._ground):
            worker.start = int(self._ground[(self._started - 1) % self._size * len(self._ground) // self._size])
        self._workers[name] = worker
        self._threads[name] = threading.Thread(target=worker.run, args=(self._events.put,), name=name)
        self._threads[name].start()
