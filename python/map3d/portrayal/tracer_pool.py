"""A pool of subprocesses that compute views, so that no view can hold or kill the server.

Each subprocess has a thread that waits for it, and keeps the scenes of its last views open with warm caches. Requests wait in one bounded queue; a
subprocess prefers those of a scene that it has open, but passes over a request only a few times.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from map3d.errors import LimitExceeded, SubprocessDied, SubprocessTimedOut
from map3d.portrayal.service_exception import ServiceException, busy
from map3d.subprocess import Failure, Limits, Message, Subprocess

ENTRY: Final = "map3d.portrayal.view_tracer:open_tracer"
DEADLINE_S: Final = 30.0
GRACE_S: Final = 5.0
"""Time after the deadline in which a subprocess has to notice it, before it is killed."""
START_S: Final = 30.0
QUEUE: Final = 64
SUBPROCESSES: Final = 2
CACHE_BYTES: Final = 256 << 20
SAMPLES: Final = 16
PATIENCE: Final = 4
"""How often a request may be passed over for one of an open scene."""

Request = Mapping[str, Any]
log: Final = logging.getLogger("map3d.portrayal")


@dataclass
class _Task:
    scene: str
    request: Request
    future: "Future[Message]"
    passed_over: int = field(default=0)


class TracerPool:
    """Starts its subprocesses with the first requests. Threads may share it."""

    def __init__(
        self,
        *,
        entry: str = ENTRY,
        subprocesses: int = SUBPROCESSES,
        queue: int = QUEUE,
        deadline_s: float = DEADLINE_S,
        cache_bytes: int = CACHE_BYTES,
        samples: int = SAMPLES,
    ) -> None:
        self._entry, self._limit, self._queue_limit = entry, subprocesses, queue
        self.deadline_s = deadline_s
        self._setup = {"cache_bytes": cache_bytes, "samples": samples}
        self._waiting: deque[_Task] = deque()
        self._changed = threading.Condition()
        self._threads: list[threading.Thread] = []
        self._idle = 0
        self._closed = False

    def submit(self, scene: str, request: Request) -> "Future[Message]":
        """Queues a request. The future raises ServiceException for a view that failed.

        Raises ServiceException with status 503 when the queue is full.
        """
        task = _Task(scene, {**request, "deadline_s": self.deadline_s}, Future())
        with self._changed:
            if self._closed or len(self._waiting) >= self._queue_limit:
                raise busy(f"{len(self._waiting)} views are waiting, the limit is {self._queue_limit}; try again later")
            self._waiting.append(task)
            if self._idle < len(self._waiting) and len(self._threads) < self._limit:
                thread = threading.Thread(target=self._work, name=f"views-{len(self._threads)}", daemon=True)
                self._threads.append(thread)
                thread.start()
            self._changed.notify_all()
        return task.future

    def waiting(self) -> int:
        """Returns the number of requests in the queue."""
        return len(self._waiting)

    def close(self) -> None:
        """Ends the subprocesses after their current views; waiting requests fail."""
        with self._changed:
            self._closed = True
            for task in self._waiting:
                task.future.set_exception(busy("the server is stopping"))
            self._waiting.clear()
            self._changed.notify_all()
        for thread in self._threads:
            thread.join()

    def _work(self) -> None:
        child: Subprocess | None = None
        scene = ""
        try:
            while (task := self._next(scene)) is not None:
                scene = task.scene
                child = self._run(task, child)
        finally:
            if child is not None:
                child.close()

    def _next(self, scene: str) -> _Task | None:
        """Returns the next request, None when the pool is closed."""
        with self._changed:
            self._idle += 1
            while not self._waiting and not self._closed:
                self._changed.wait()
            self._idle -= 1
            return None if self._closed else _take(self._waiting, scene)

    def _run(self, task: _Task, child: Subprocess | None) -> Subprocess | None:
        """Answers a request with a subprocess; returns the subprocess for the next one, None if it ended."""
        if not task.future.set_running_or_notify_cancel():
            return child
        try:
            if child is None:
                child = Subprocess(self._entry, self._setup, limits=Limits(network=False, open_files=4096))
                child.wait_ready(START_S)
            response = child.request(task.request, wall_s=self.deadline_s + GRACE_S)
            _settle(task.future, lambda: _result(response))
        except SubprocessTimedOut:
            text = f"the view took longer than the limit of {self.deadline_s:g} s; ask for a smaller image or fewer layers"
            task.future.set_exception(ServiceException("NoApplicableCode", text, status=504))
            child = _close(child)
        except (SubprocessDied, LimitExceeded, OSError) as error:
            log.error("a view could not be computed: %s", error)
            task.future.set_exception(ServiceException("NoApplicableCode", "the view could not be computed; see the server log"))
            child = _close(child)
        except BaseException as error:
            task.future.set_exception(error)
            child = _close(child)
        return child


def _take(waiting: deque[_Task], scene: str) -> _Task:
    """Takes the first request of the scene, unless that passes over the oldest one too often."""
    oldest = waiting[0]
    if oldest.scene != scene and oldest.passed_over < PATIENCE:
        for task in waiting:
            if task.scene == scene:
                oldest.passed_over += 1
                waiting.remove(task)
                return task
    return waiting.popleft()


def _settle(future: "Future[Message]", result: Callable[[], Message]) -> None:
    try:
        value = result()
    except ServiceException as error:
        future.set_exception(error)
    else:
        future.set_result(value)


def _result(response: Message | Failure) -> Message:
    """Raises ServiceException for an exception of the subprocess."""
    if isinstance(response, Failure):
        if response.kind == "LimitError":
            raise ServiceException("NoApplicableCode", f"the view reached a limit: {response.message}", status=504)
        if response.kind in ("SceneRebuilt", "FormatError", "StorageError"):
            raise busy("the scene is being built; try again later")
        if response.kind == "InvalidArgument":
            raise ServiceException("InvalidParameterValue", f"portrayals: {response.message}", "portrayals")
        log.error("a view could not be computed: %s: %s", response.kind, response.message)
        raise ServiceException("NoApplicableCode", "the view could not be computed; see the server log")
    if "refused" in response.value:
        raise ServiceException("OptionNotSupported", str(response.value["refused"]), "portrayals")
    return response


def _close(child: Subprocess | None) -> Subprocess | None:
    """Returns None."""
    if child is not None:
        with suppress(OSError):
            child.close()
    return None
