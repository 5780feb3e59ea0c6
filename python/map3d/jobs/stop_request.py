"""The user's request to stop: SIGINT and SIGTERM."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from map3d.jobs.events import Stopping


class StopRequest:
    """A stop in two stages: workers finish their jobs and exit, or release them at once. One request lasts for a whole command, with all its pools
    and plans.

    Signal handlers run between any two bytecodes of the main thread, so a request takes no lock: it stores a number and informs the listener, whose
    `put` must be reentrant as that of `queue.SimpleQueue` is.
    """

    def __init__(self) -> None:
        self._stage = 0
        self._listener: Callable[[Stopping], None] | None = None

    @property
    def is_made(self) -> bool:
        return self._stage > 0

    def finish_jobs(self) -> None:
        """Makes the workers finish their jobs and exit."""
        self._reach(1)

    def release_jobs(self) -> None:
        """Makes the workers release their jobs and exit."""
        self._reach(2)

    def _reach(self, stage: int) -> None:
        if stage > self._stage:
            self._stage = stage
            if self._listener is not None:
                self._listener(Stopping(at_once=stage > 1))

    def _on_signal(self, _number: int, _frame: object) -> None:
        self._reach(min(self._stage + 1, 2))

    @contextmanager
    def heard_by(self, listener: Callable[[Stopping], None]) -> Iterator[None]:
        """Informs the listener of calls while the context lasts."""
        self._listener = listener
        try:
            yield
        finally:
            self._listener = None

    @contextmanager
    def on_signals(self) -> Iterator[None]:
        """Makes the first SIGINT or SIGTERM the first stage of this request and the second one the second stage; outside the main thread, where
        Python cannot handle signals, changes nothing."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.signal(number, self._on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
