"""The tile stores of a workspace as they are asked for; a store that was put in place of another is noticed."""

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
"""How long a store is trusted to be still the file of its name."""

MAX_OPEN: Final = 256


@dataclass(eq=False)
class OpenStore:
    """A store with the identity of its file."""

    store: SqliteTileStore
    identity: tuple[int, int]
    checked_s: float

    @cached_property
    def layers(self) -> dict[str, tuple[int, Layer]]:
        """name → (number, layer)."""
        return {layer.name: (number, layer) for number, layer in enumerate(self.store.shape.layers)}

    def is_current(self, now_s: float) -> bool:
        """False once the file is gone or another one lies in its place."""
        if now_s - self.checked_s < RECHECK_S:
            return True
        self.checked_s = now_s
        return _identity(self.store) == self.identity


class Stores:
    """Safe to share between threads."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._open: dict[tuple[str, str], OpenStore] = {}
        self._lock = threading.Lock()

    def of_view(self, rendering: str, view: str) -> Iterator[OpenStore]:
        """The stores of a view's tracks, pass by pass; none: there is no such rendering, or no such view of it."""
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
        """None: there is none. Reads the disk at most once in a while."""
        key = (rendering, track)
        with self._lock:
            held = self._open.get(key)
            if held is not None and held.is_current(time.monotonic()):
                return held
            if held is not None:
                self._open.pop(key).store.close()
            opened = self._try_open(rendering, track)
            if opened is not None:
                self._make_room()
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

    def _make_room(self) -> None:
        while len(self._open) >= MAX_OPEN:
            oldest = next(iter(self._open))
            self._open.pop(oldest).store.close()


def _identity(store: SqliteTileStore) -> tuple[int, int] | None:
    try:
        stat = store.path.stat()
    except OSError:
        return None
    return stat.st_dev, stat.st_ino
