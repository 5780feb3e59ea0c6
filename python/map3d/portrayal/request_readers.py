"""The threads that read requests: they parse them, plan views and answer what is stored.

Planning a view takes a millisecond of the web process, in which tiles and pages wait. While the queue of computations is full, requests are therefore
read one at a time. A few wait for that; further ones are refused unread, except those that were answered before, because their views are stored.
"""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final

THREADS: Final = 4
MOST_WAITING: Final = 16
"""Requests that are read or wait for it while the queue is full."""
REMEMBERED: Final = 10_000


class RequestReaders:
    """Threads may share it. `is_full`: whether the queue of computations is full; it returns at once."""

    def __init__(self, is_full: Callable[[], bool]) -> None:
        self._is_full = is_full
        self._several = ThreadPoolExecutor(THREADS, thread_name_prefix="portrayal")
        self._single = ThreadPoolExecutor(1, thread_name_prefix="portrayal-full")
        self._lock = threading.Lock()
        self._waiting = 0
        self._answered: OrderedDict[bytes, None] = OrderedDict()

    def submit(self, request: bytes, read: Callable[[], None]) -> bool:
        """Calls `read` in a thread. Returns False, without calling it, for a request that is refused."""
        if not self._is_full():
            self._several.submit(read)
            return True
        with self._lock:
            if self._waiting >= MOST_WAITING and _digest(request) not in self._answered:
                return False
            self._waiting += 1
        self._single.submit(self._read_single, read)
        return True

    def remember(self, request: bytes) -> None:
        """Remembers a request that was answered."""
        key = _digest(request)
        with self._lock:
            self._answered[key] = None
            self._answered.move_to_end(key)
            if len(self._answered) > REMEMBERED:
                self._answered.popitem(last=False)

    def close(self) -> None:
        self._several.shutdown(cancel_futures=True)
        self._single.shutdown(cancel_futures=True)

    def _read_single(self, read: Callable[[], None]) -> None:
        try:
            read()
        finally:
            with self._lock:
                self._waiting -= 1


def _digest(request: bytes) -> bytes:
    return hashlib.blake2b(request, digest_size=16).digest()
