"""The workers of one `map3d render`: one thread and one subprocess each."""

import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from map3d.catalogue import Catalogue, State
from map3d.jobs.dead_workers import expire_dead_workers, worker_name
from map3d.jobs.events import JobDone, JobFailed, LeaseLost, RunEvent, SceneChanged, Stopping, Waiting, WorkerExited
from map3d.jobs.timeouts import Timeouts
from map3d.jobs.worker import Signal, Task, Worker
from map3d.tiles.naming import morton

_POLL_S = 0.2


@dataclass
class RunStatistics:
    """Counts of what a run did. `bytes`: encoded; `exit_reasons`: of workers that exited before the run ended."""

    done: int = 0
    empty: int = 0
    tiles: int = 0
    base_tiles: int = 0
    bytes: int = 0
    failed_attempts: int = 0
    lost_leases: int = 0
    exit_reasons: list[str] = field(default_factory=list)

    def add(self, event: RunEvent) -> None:
        if isinstance(event, JobDone):
            self.done += 1
            self.empty += event.result.empty
            self.tiles += event.result.tiles
            self.base_tiles += event.result.base_tiles
            self.bytes += event.result.bytes
        elif isinstance(event, JobFailed):
            self.failed_attempts += 1
        elif isinstance(event, LeaseLost):
            self.lost_leases += 1
        elif isinstance(event, WorkerExited) and event.reason:
            self.exit_reasons.append(f"{event.worker}: {event.reason}")


class Pool:
    """Runs `size` workers until no jobs are left.

    Replaces a worker that exited because of failed jobs as long as the run completes any job: then the jobs are at fault, not the machine.
    """

    def __init__(self, catalogue: Catalogue, rendering: str, task: Task, size: int, timeouts: Timeouts | None = None) -> None:
        self._catalogue, self._rendering, self._task, self._timeouts = catalogue, rendering, task, timeouts or Timeouts()
        self._size = size
        self._events: queue.SimpleQueue[RunEvent] = queue.SimpleQueue()
        self._stop, self._stop_now, self._job_ended = threading.Event(), threading.Event(), Signal()
        self._threads: dict[str, threading.Thread] = {}
        self._workers: dict[str, Worker] = {}
        self._started = 0
        self._waiting_reported = self._stopped_by_user = False
        self.scene_changed = False
        """The plan is stale: the pool stops after the current jobs, and the run plans again."""
        self._base_numbers: list[int] = []
        self._error: BaseException | None = None
        self.statistics = RunStatistics()

    def stop(self) -> None:
        """Makes the workers finish their jobs and exit."""
        self._stopped_by_user = True
        self._let_workers_exit()

    def _let_workers_exit(self) -> None:
        self._stop.set()
        self._job_ended.notify()

    def stop_now(self) -> None:
        """Makes the workers release their jobs and exit."""
        self._stop_now.set()
        self.stop()

    @property
    def stopped(self) -> bool:
        return self._stopped_by_user

    def run(self, on_event: Callable[[RunEvent], None]) -> RunStatistics:
        """Blocks until the last worker exits and calls `on_event` in this thread. The first SIGINT or SIGTERM calls `stop`, the second `stop_now`."""
        expire_dead_workers(self._catalogue, self._rendering)
        self._base_numbers = self._open_base_numbers()
        with _signals(self._on_signal):
            for _ in range(self._size):
                self._start_worker()
            while self._threads or not self._events.empty():
                self._handle_next(on_event)
        if self._error is not None:
            raise self._error
        return self.statistics

    def _open_base_numbers(self) -> list[int]:
        """Returns the sorted Morton numbers of the base blocks to do, of all views."""
        jobs = self._catalogue.jobs(self._rendering, state=State.TODO)
        return sorted(morton(job.block.x, job.block.y) for job in jobs if job.kind == "base")

    def _on_signal(self) -> None:
        self._events.put(Stopping(at_once=self.stopped))
        self.stop_now() if self.stopped else self.stop()

    def _handle_next(self, on_event: Callable[[RunEvent], None]) -> None:
        try:
            event = self._events.get(timeout=_POLL_S)
        except queue.Empty:
            self._report_waiting(on_event)
            return
        self.statistics.add(event)
        if isinstance(event, SceneChanged):
            self.scene_changed = True
            self._let_workers_exit()
        if isinstance(event, WorkerExited):
            self._error = self._error or event.error
            self._threads.pop(event.worker).join()
            del self._workers[event.worker]
            if event.jobs_failed and self.statistics.done and not self._stop.is_set():
                self._start_worker()
        on_event(event)

    def _report_waiting(self, on_event: Callable[[RunEvent], None]) -> None:
        """Reports `Waiting` once, when all workers have been idle for long enough."""
        latest = time.monotonic() - self._timeouts.wait_s
        idle = [worker.idle_since for worker in self._workers.values()]
        if self._waiting_reported or not idle or any(since is None or since > latest for since in idle):
            return
        self._waiting_reported = True
        on_event(Waiting(self._catalogue.count_jobs(self._rendering)[State.LEASED]))

    def _start_worker(self) -> None:
        self._started += 1
        name = worker_name(self._started)
        worker = Worker(name, self._catalogue, self._rendering, self._task, self._timeouts, self._stop, self._stop_now, self._job_ended)
        if self._base_numbers:
            worker.start = self._base_numbers[(self._started - 1) % self._size * len(self._base_numbers) // self._size]
        self._workers[name] = worker
        self._threads[name] = threading.Thread(target=worker.run, args=(self._events.put,), name=name)
        self._threads[name].start()


@contextmanager
def _signals(act: Callable[[], None]) -> Iterator[None]:
    """Makes SIGINT and SIGTERM call `act` instead of raising; outside the main thread, where Python cannot handle signals, changes nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, lambda *_: act()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
