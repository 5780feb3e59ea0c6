"""The blocks that requests wait for, in one process."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from map3d.errors import Unavailable
from map3d.jobs.on_demand_cache import Place
from map3d.types import BlockKind

BUSY_RETRY_S: Final = 5
"""Seconds after which a client tries again when the queue is full or a block takes long."""


@dataclass(eq=False)
class Demand:
    """A block that requests wait for. `ended` has a result when its job is done or no longer planned, else an exception.

    `requests`: number of clients that wait; `kept`: it is rendered even if they all go away.
    """

    place: Place
    kind: BlockKind
    ended: Future[None] = field(default_factory=Future)
    requests: int = 0
    kept: bool = False

    def end(self, error: Exception | None = None) -> None:
        with suppress(InvalidStateError):
            if error is None:
                self.ended.set_result(None)
            else:
                self.ended.set_exception(error)


class Demands:
    """A bounded queue in which each block is at most once: base blocks first, then reduce blocks, each in the order in which they were asked for.
    Thread-safe."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._changed = threading.Condition()
        self._waiting: dict[Place, Demand] = {}
        self._version = 0

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def version(self) -> int:
        return self._version

    def add(self, place: Place, kind: BlockKind, *, keep: bool = False) -> Demand:
        """Returns the demand for a block, a new one unless it is waited for. Raises Unavailable when the queue is full."""
        with self._changed:
            demand = self._waiting.get(place)
            if demand is None:
                if len(self._waiting) >= self._limit:
                    raise Unavailable(f"{self._limit} blocks are waiting to be rendered; try again in {BUSY_RETRY_S} s", BUSY_RETRY_S)
                demand = self._waiting[place] = Demand(place, kind)
            demand.kept |= keep
            demand.requests += not keep
            self._notify()
        return demand

    def leave(self, demand: Demand, *, keep: bool) -> None:
        """A client no longer waits. Without `keep`, the demand is dropped if no other client waits for it."""
        with self._changed:
            demand.requests -= 1
            demand.kept |= keep
            if demand.requests <= 0 and not demand.kept:
                self._remove(demand)

    def end(self, demand: Demand, error: Exception | None = None) -> None:
        with self._changed:
            self._remove(demand)
            self._notify()
        demand.end(error)

    def find(self, place: Place) -> Demand | None:
        with self._changed:
            return self._waiting.get(place)

    def of_rendering(self, rendering: str) -> list[Demand]:
        return [demand for demand in self if demand.place[0] == rendering]

    def __iter__(self) -> Iterator[Demand]:
        with self._changed:
            listed = list(self._waiting.values())
        yield from sorted(listed, key=lambda demand: demand.kind != "base")

    def wait(self, since: int, timeout_s: float) -> None:
        """Waits until `version` differs from `since`: a demand was added or has ended."""
        with self._changed:
            self._changed.wait_for(lambda: self._version != since, timeout_s)

    def wake(self) -> None:
        with self._changed:
            self._notify()

    def _notify(self) -> None:
        self._version += 1
        self._changed.notify_all()

    def _remove(self, demand: Demand) -> None:
        if self._waiting.get(demand.place) is demand:
            del self._waiting[demand.place]
