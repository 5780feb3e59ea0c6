"""A worker: leases jobs one after another, has its child do them, commits what the child made (spec/catalogue.md).

Commit of a block: the child renders → check → `commit` (one transaction of the tile store) → `done` with the fence.
"""

import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from map3d.catalogue import Catalogue, JobResult, Lease, State
from map3d.errors import ChildRefused, Map3dError, StaleFence
from map3d.jobs.events import Done, Event, Failed, Left, Lost
from map3d.jobs.timeouts import Terms
from map3d.subprocess import Child, Failure, Message
from map3d.tiles.naming import morton


class Task(Protocol):
    """What a job is about; the worker itself knows only leases and children."""

    def start_child(self) -> Child: ...

    def question(self, lease: Lease) -> dict[str, Any]:
        """What the child is asked."""

    def commit(self, lease: Lease, answer: Message) -> JobResult:
        """Checks what the child made and stores it; durable on return."""


class News:
    """Wakes workers that wait for a job when another one finished one, which may have opened the next."""

    def __init__(self) -> None:
        self._changed, self._count = threading.Condition(), 0

    @property
    def count(self) -> int:
        return self._count

    def tell(self) -> None:
        with self._changed:
            self._count += 1
            self._changed.notify_all()

    def wait(self, since: int, timeout_s: float) -> None:
        """Until there is news after `since`, a count from before."""
        with self._changed:
            self._changed.wait_for(lambda: self._count != since, timeout_s)


class Abandoned(Map3dError):
    """The user wants out at once."""


class Worker:
    """Runs in a thread of its own. `stop` set: finishes the job in hand and leaves; `abandon` set: gives it back and leaves."""

    def __init__(
        self, name: str, catalogue: Catalogue, rendering: str, task: Task, terms: Terms, stop: threading.Event, abandon: threading.Event, news: News
    ) -> None:
        self.name, self._news = name, news
        self._catalogue, self._rendering, self._task, self._terms = catalogue, rendering, task, terms
        self._stop, self._abandon = stop, abandon
        self._child: Child | None = None
        self._failed: set[tuple[str, str]] = set()
        self.start = 0
        """Morton number of base blocks from which on it goes: neighbours share chunks and textures."""
        self.idle_since: float | None = None
        """Monotonic seconds; None while it has a job or a child starts."""

    def run(self, tell: Callable[[Event], None]) -> None:
        """Works until there is nothing more to do, then tells `Left`."""
        left = Left(self.name)
        try:
            left = self._work_on(tell)
        except Map3dError as error:
            left = Left(self.name, str(error))
        except BaseException as error:
            left = Left(self.name, f"{type(error).__name__}: {error}", error=error)
        finally:
            self._drop_child()
            tell(left)

    def _work_on(self, tell: Callable[[Event], None]) -> Left:
        while not self._stop.is_set():
            child = self._ready_child()
            if child is None:
                break
            since = self._news.count
            lease = self._catalogue.lease(self._rendering, self.name, self.start)
            if lease is not None:
                self.idle_since = None
                if lease.kind == "base":
                    self.start = morton(lease.block.x, lease.block.y)
                tell(self._work(child, lease))
                self._news.tell()
            elif self._nothing_left():
                break
            else:
                self.idle_since = self.idle_since or time.monotonic()
                self._news.wait(since, self._terms.idle_s)
            if len(self._failed) >= self._terms.failures:
                return Left(self.name, f"failed {len(self._failed)} different jobs", jobs_failed=True)
        return Left(self.name)

    def _nothing_left(self) -> bool:
        counts = self._catalogue.count_jobs(self._rendering)
        return counts[State.TODO] + counts[State.LEASED] == 0

    def _work(self, child: Child, lease: Lease) -> Event:
        hold = _Hold(self._catalogue, lease, self._terms, self._abandon)
        try:
            answer = child.ask(self._task.question(lease), wall_s=self._terms.block_s, every_s=self._terms.tick_s, meanwhile=hold.look)
            if isinstance(answer, Failure):
                return self._fail(lease, f"{answer.kind}: {answer.message}")
            hold.beat()
            result = self._task.commit(lease, answer)
            self._catalogue.done(lease, result)
            return Done(lease, result)
        except StaleFence as error:
            self._drop_child()
            return Lost(lease, str(error))
        except Abandoned as error:
            self._drop_child()
            return self._give_back(lease, str(error))
        except Map3dError as error:
            self._drop_child()
            return self._fail(lease, str(error))

    def _give_back(self, lease: Lease, reason: str) -> Event:
        try:
            self._catalogue.release(lease)
        except StaleFence as error:
            return Lost(lease, f"{reason}; {error}")
        return Lost(lease, reason)

    def _fail(self, lease: Lease, reason: str) -> Event:
        try:
            state = self._catalogue.fail(lease, reason)
        except StaleFence as error:
            return Lost(lease, f"{reason}; {error}")
        self._failed.add((lease.track, str(lease.block)))
        return Failed(lease, reason, state)

    def _ready_child(self) -> Child | None:
        """None: stopped while it tried. Raises ChildRefused, or ChildDied after too many tries."""
        for attempt in range(1, self._terms.starts + 1):
            if self._child is not None:
                return self._child
            try:
                self._child = self._task.start_child()
                self._child.wait_ready(self._terms.start_s)
            except Map3dError as error:
                self._drop_child()
                if isinstance(error, ChildRefused) or attempt == self._terms.starts:
                    raise
                if self._stop.wait(self._terms.start_pause_s * attempt):
                    return None
        return self._child

    def _drop_child(self) -> None:
        if self._child is not None:
            self._child.close()
            self._child = None


class _Hold:
    """Keeps a lease while the child works."""

    def __init__(self, catalogue: Catalogue, lease: Lease, terms: Terms, abandon: threading.Event) -> None:
        self._catalogue, self._lease, self._terms, self._abandon = catalogue, lease, terms, abandon
        self._beaten = time.monotonic()

    def look(self, _told: object) -> None:
        """Raises Abandoned when the user wants out, StaleFence when the lease is lost."""
        if self._abandon.is_set():
            raise Abandoned("abandoned by the user")
        if time.monotonic() - self._beaten >= self._terms.heartbeat_s:
            self.beat()

    def beat(self) -> None:
        self._catalogue.heartbeat(self._lease)
        self._beaten = time.monotonic()
