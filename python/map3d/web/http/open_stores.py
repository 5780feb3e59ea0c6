"""Opens the tile stores of a workspace on demand, and reopens a store that was replaced."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import count
from typing import Final

from map3d.errors import BadRequest, NotFound
from map3d.geometry.views import parse_view_id, track_id
from map3d.tiles.decode_tile import find_layer, layer_names
from map3d.tiles.tile_store import TileStore
from map3d.tiles.track_stores import open_track
from map3d.types import Layer
from map3d.web.http.shared_catalogue import SharedCatalogue

RECHECK_S: Final = 1.0
"""Interval between checks that a store was not replaced."""

MAX_OPEN: Final = 256


@dataclass(eq=False)
class OpenStore:
    """An open store, and when it was last compared with the one at its URL."""

    store: TileStore
    checked_s: float
    is_planned_anew: Callable[[], bool] = lambda: False
    """Whether jobs of the rendering were opened since, so that any of its blocks may be stale. Called often; no I/O."""

    @cached_property
    def layers(self) -> dict[str, tuple[int, Layer]]:
        """Layer name → (number, layer)."""
        return {layer.name: (number, layer) for number, layer in enumerate(self.store.shape.layers)}

    def is_fresh(self, now_s: float) -> bool:
        """Whether the store is current without another look at its URL. No I/O."""
        return now_s - self.checked_s < RECHECK_S and not self.is_planned_anew()

    def is_current(self, now_s: float) -> bool:
        """Whether the store at the URL is still the one that is open."""
        if self.is_planned_anew():
            return False
        if now_s - self.checked_s < RECHECK_S:
            return True
        self.checked_s = now_s
        return self.store.is_current()


@dataclass(frozen=True)
class FoundLayer:
    """`asked`: the layer that a request names; `stored`: the one that has its pixels (map3d.tiles.decode_tile), `number` in the store."""

    opened: OpenStore
    number: int
    asked: Layer
    stored: Layer


class OpenStores:
    """Thread-safe."""

    def __init__(self, catalogue: SharedCatalogue, epoch: Callable[[str], object] = lambda _rendering: None) -> None:
        """`epoch` returns a value for a rendering that differs after each plan that opened jobs."""
        self._catalogue, self._epoch = catalogue, epoch
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

    def find_layer(self, rendering: str, view: str, layer: str) -> FoundLayer | None:
        """Returns the layer of a name; None if the rendering, the view or the layer does not exist."""
        others = []
        for opened in self.stores_of_view(rendering, view):
            if layer in opened.layers:
                number, stored = opened.layers[layer]
                return FoundLayer(opened, number, stored, stored)
            others.append(opened)
        for opened in others:
            found = find_layer(opened.store.shape.layers, layer)
            if found is not None:
                return FoundLayer(opened, opened.layers[found[1].name][0], *found)
        return None

    def layer_names(self, rendering: str, view: str) -> list[str]:
        """Returns the names of the layers that `find_layer` finds."""
        return layer_names(stored for opened in self.stores_of_view(rendering, view) for stored in opened.store.shape.layers)

    def _get(self, rendering: str, track: str) -> OpenStore | None:
        """Returns None if there is no store. Checks the file at most every RECHECK_S."""
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
        epoch = self._epoch(rendering)
        try:
            store = open_track(self._catalogue.workspace, self._catalogue().rendering(rendering), track)
        except (NotFound, BadRequest):
            return None
        return OpenStore(store, time.monotonic(), lambda: self._epoch(rendering) != epoch)

    def _evict(self) -> None:
        while len(self._open) >= MAX_OPEN:
            oldest = next(iter(self._open))
            self._open.pop(oldest).store.close()
