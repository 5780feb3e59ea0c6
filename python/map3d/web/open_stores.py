"""Opens the tile stores of a workspace on demand, and reopens a store whose file was replaced."""

import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Final

from map3d.catalogue.workspace import Workspace
from map3d.errors import BadRequest, NotFound
from map3d.geometry.views import parse_view_id, track_id
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import Layer

RECHECK_S: Final = 1.0
"""Interval between checks that a store is still the file at its path."""

MAX_OPEN: Final = 256


@dataclass(eq=False)
class OpenStore:
    """An open store and the identity (device, inode) of its file."""

    store: SqliteTileStore
    identity: tuple[int, int]
    checked_s: float

    @cached_property
    def layers(self) -> dict[str, tuple[int, Layer]]:
        """Layer name → (number, layer)."""
        return {layer.name: (number, layer) for number, layer in enumerate(self.store.shape.layers)}

    def is_current(self, now_s: float) -> bool:
        """Whether the file at the path is still the one that is open."""
        if now_s - self.checked_s < RECHECK_S:
            return True
        self.checked_s = now_s
        return _identity(self.store) == self.identity


class OpenStores:
    """Thread-safe."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._open: dict[tuple[str, str], OpenStore] = {}
        self._lock = threading.Lock()

    def stores_of_view(self, rendering: str, view: str) -> Iterator[OpenStore]:
        """Yields the stores of a view's tracks, pass by pass; none if the rendering or the view does not exist."""
        try:
            parse_view_id(view)
        except BadRequest:
            return
        for number in count():
            opened = self._get(rendering, track_id(view, number))
            if opened is None:
                return
            yield opened

    def _get(self, rendering: str, track: str) -> OpenStore | None:
        """Returns None without a store. Checks the file at most every RECHECK_S."""
        key = (rendering, track)
        with self._lock:
            known = self._open.get(key)
            if known is not None and known.is_current(time.monotonic()):
                return known
            if known is not None:
                self._open.pop(key).store.close()
            opened = self._try_open(rendering, track)
            if opened is not None:
                self._evict()
                self._open[key] = opened
            return opened

    def close(self) -> None:
        with self._lock:
            while self._open:
                self._open.popitem()[1].store.close()

    def _try_open(self, rendering: str, track: str) -> OpenStore | None:
        try:
            store = SqliteTileStore(self._workspace.store_path(rendering, track), read_only=True)
        except (NotFound, BadRequest):
            return None
        identity = _identity(store)
        return None if identity is None else OpenStore(store, identity, time.monotonic())

    def _evict(self) -> None:
        while len(self._open) >= MAX_OPEN:
            oldest = next(iter(self._open))
            self._open.pop(oldest).store.close()


def _identity(store: SqliteTileStore) -> tuple[int, int] | None:
    try:
        stat = store.path.stat()
    except OSError:
        return None
    return stat.st_dev, stat.st_ino
