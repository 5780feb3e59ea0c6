"""The workers of one `map3d render`: a thread each, every one with its own child."""

import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from map3d.catalogue import Catalogue, State
from map3d.jobs.events import Done, Event, Failed, Left, Lost, Stopping, Waiting
from map3d.jobs.timeouts import Terms
from map3d.jobs.worker import News, Task, Worker
from map3d.tiles.naming import morton

_LOOK_S = 0.2


@dataclass
class Tally:
    """What a run did."""

    done: int = 0
    empty: int = 0
    tiles: int = 0
    base_tiles: int = 0
    bytes: int = 0
    failed_attempts: int = 0
    lost_leases: int = 0
    left_early: list[str] = field(default_factory=list)

    def add(self, event: Event) -> None:
        if isinstance(event, Done):
            self.done += 1
            self.empty += event.result.empty
            self.tiles += event.result.tiles
            self.base_tiles += event.result.base_tiles
            self.bytes += event.result.bytes
        elif isinstance(event, Failed):
            self.failed_attempts += 1
        elif isinstance(event, Lost):
            self.lost_leases += 1
        elif isinstance(event, Left) and event.because:
            self.left_early.append(f"{event.worker}: {event.because}")


class Pool:
    """Runs `size` workers until nothing is left to do.

    A worker that left because jobs failed is replaced as long as the run gets anything done: then the jobs are at fault, not the machine.
    """

    def __init__(self, catalogue: Catalogue, rendering: str, task: Task, size: int, terms: Terms | None = None, host: str = "local") -> None:
        self._catalogue, self._rendering, self._task, self._terms = catalogue, rendering, task, terms or Terms()
        self._size, self._host = size, host
        self._events: queue.SimpleQueue[Event] = queue.SimpleQueue()
        self._stop, self._abandon, self._news = threading.Event(), threading.Event(), News()
        self._threads: dict[str, threading.Thread] = {}
        self._workers: dict[str, Worker] = {}
        self._started = 0
        self._told_waiting = False
        self._places: list[int] = []
        self._error: BaseException | None = None
        self.tally = Tally()

    def stop(self) -> None:
        """Workers finish the jobs in hand and leave."""
        self._stop.set()
        self._news.tell()

    def abandon(self) -> None:
        """Workers give the jobs in hand back and leave."""
        self._abandon.set()
        self.stop()

    @property
    def stopped(self) -> bool:
        return self._stop.is_set()

    def run(self, on_event: Callable[[Event], None]) -> Tally:
        """Blocks; `on_event` is called in the caller's thread. While it runs, the first SIGINT or SIGTERM stops the pool, the second abandons."""
        self._places = self._base_places()
        with _signals(self._on_signal):
            for _ in range(self._size):
                self._start_worker()
            while self._threads or not self._events.empty():
                self._next(on_event)
        if self._error is not None:
            raise self._error
        return self.tally

    def _base_places(self) -> list[int]:
        """Morton numbers of the base blocks to do, of all views together."""
        jobs = self._catalogue.jobs(self._rendering, state=State.TODO)
        return sorted(morton(job.block.x, job.block.y) for job in jobs if job.kind == "base")

    def _on_signal(self) -> None:
        self._events.put(Stopping(abandoning=self.stopped))
        self.abandon() if self.stopped else self.stop()

    def _next(self, on_event: Callable[[Event], None]) -> None:
        try:
            event = self._events.get(timeout=_LOOK_S)
        except queue.Empty:
            self._tell_if_waiting(on_event)
            return
        self.tally.add(event)
        if isinstance(event, Left):
            self._error = self._error or event.error
            self._threads.pop(event.worker).join()
            del self._workers[event.worker]
            if event.jobs_failed and self.tally.done and not self.stopped:
                self._start_worker()
        on_event(event)

    def _tell_if_waiting(self, on_event: Callable[[Event], None]) -> None:
        """Once."""
        latest = time.monotonic() - self._terms.wait_s
        idle = [worker.idle_since for worker in self._workers.values()]
        if self._told_waiting or not idle or any(since is None or since > latest for since in idle):
            return
        self._told_waiting = True
        on_event(Waiting(self._catalogue.count_jobs(self._rendering)[State.LEASED]))

    def _start_worker(self) -> None:
        self._started += 1
        name = f"{self._host}-{self._started}"
        worker = Worker(name, self._catalogue, self._rendering, self._task, self._terms, self._stop, self._abandon, self._news)
        if self._places:
            worker.start = self._places[(self._started - 1) % self._size * len(self._places) // self._size]
        self._workers[name] = worker
        self._threads[name] = threading.Thread(target=worker.run, args=(self._events.put,), name=name)
        self._threads[name].start()


@contextmanager
def _signals(act: Callable[[], None]) -> Iterator[None]:
    """SIGINT and SIGTERM call `act` instead of raising; where signals cannot be taken (not the main thread) nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, lambda *_: act()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
