"""The blocks that requests wait for, in one process."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from map3d.errors import Unavailable
from map3d.jobs.on_demand.cache import BlockAddress
from map3d.types import BlockKind

BUSY_RETRY_S: Final = 5
"""Seconds after which a client tries again when the queue is full or a block takes long."""


@dataclass(eq=False)
class BlockRequest:
    """A block that requests wait for. `ended` has a result when its job is done or no longer planned, else an exception.

    `clients`: number of clients that wait; `kept`: it is rendered even if they all go away.
    """

    address: BlockAddress
    kind: BlockKind
    ended: Future[None] = field(default_factory=Future)
    clients: int = 0
    kept: bool = False

    def end(self, error: Exception | None = None) -> None:
        with suppress(InvalidStateError):
            if error is None:
                self.ended.set_result(None)
            else:
                self.ended.set_exception(error)


class BlockRequests:
    """A bounded queue in which each block is at most once: base blocks first, then reduce blocks, each in the order in which they were asked for.
    Thread-safe."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._changed = threading.Condition()
        self._waiting: dict[BlockAddress, BlockRequest] = {}
        self._version = 0

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def version(self) -> int:
        return self._version

    def add(self, address: BlockAddress, kind: BlockKind, *, keep: bool = False) -> BlockRequest:
        """Returns the request for a block, a new one unless it is waited for. Raises Unavailable when the queue is full."""
        with self._changed:
            request = self._waiting.get(address)
            if request is None:
                if len(self._waiting) >= self._limit:
                    raise Unavailable(f"{self._limit} blocks are waiting to be rendered; try again in {BUSY_RETRY_S} s", BUSY_RETRY_S)
                request = self._waiting[address] = BlockRequest(address, kind)
            request.kept |= keep
            request.clients += not keep
            self._notify()
        return request

    def leave(self, request: BlockRequest, *, keep: bool) -> None:
        """A client no longer waits. Without `keep`, the request is dropped if no other client waits for it."""
        with self._changed:
            request.clients -= 1
            request.kept |= keep
            if request.clients <= 0 and not request.kept:
                self._remove(request)

    def end(self, request: BlockRequest, error: Exception | None = None) -> None:
        with self._changed:
            self._remove(request)
            self._notify()
        request.end(error)

    def find(self, address: BlockAddress) -> BlockRequest | None:
        with self._changed:
            return self._waiting.get(address)

    def of_rendering(self, rendering: str) -> list[BlockRequest]:
        return [request for request in self if request.address[0] == rendering]

    def __iter__(self) -> Iterator[BlockRequest]:
        with self._changed:
            listed = list(self._waiting.values())
        yield from sorted(listed, key=lambda request: request.kind != "base")

    def wait(self, since: int, timeout_s: float) -> None:
        """Waits until `version` differs from `since`: a request was added or has ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._version != since, timeout_s)

    def wake(self) -> None:
        with self._changed:
            self._notify()

    def _notify(self) -> None:
        self._version += 1
        self._changed.notify_all()

    def _remove(self, request: BlockRequest) -> None:
        if self._waiting.get(request.address) is request:
            del self._waiting[request.address]
