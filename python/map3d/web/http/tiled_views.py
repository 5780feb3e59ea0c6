"""The tiled views of a workspace's renderings, read from their manifests on demand and again when those change."""

import threading
import time
from dataclasses import dataclass
from typing import Final

from map3d.catalogue import RenderingRecord
from map3d.errors import Map3dError
from map3d.tile_services.tiled_view import TiledView, find_tiled_view, tiled_views
from map3d.tiles.manifest import Manifest
from map3d.tiles.track_stores import read_manifest
from map3d.types import check_name
from map3d.web.http.http_errors import status_of
from map3d.web.http.shared_catalogue import SharedCatalogue

RECHECK_S: Final = 1.0
"""Interval between readings of a manifest."""
MAX_KNOWN: Final = 1024


@dataclass
class _Known:
    data: bytes
    views: tuple[TiledView, ...]
    checked_s: float


class TiledViews:
    """Thread-safe."""

    def __init__(self, catalogue: SharedCatalogue) -> None:
        self._catalogue = catalogue
        self._known: dict[str, _Known] = {}
        self._lock = threading.Lock()

    def known_view(self, rendering: str, view_id: str) -> TiledView | None:
        """Returns a view without reading anything; None if it is unknown or was last read more than RECHECK_S ago."""
        known = self._known.get(rendering)
        if known is None or time.monotonic() - known.checked_s >= RECHECK_S:
            return None
        return next((view for view in known.views if view.id == view_id), None)

    def view(self, rendering: str, view_id: str) -> TiledView:
        """Returns the view `<rendering>:<view>`. Raises NotFound."""
        return find_tiled_view(self.views_of(check_name(rendering, "rendering")), view_id)

    def views_of(self, rendering: str) -> tuple[TiledView, ...]:
        """Returns the views of a rendering; none before it has tiles, or if it has no colour layer. Raises NotFound."""
        with self._lock:
            known = self._known.get(rendering)
            if known is not None and time.monotonic() - known.checked_s < RECHECK_S:
                return known.views
            return self._read(self._catalogue().rendering(rendering))

    def all(self) -> tuple[TiledView, ...]:
        """Returns the views of all renderings, by name; leaves out renderings whose manifest is unreadable."""
        with self._lock:
            records = sorted(self._catalogue().renderings(), key=lambda record: record.name)
            return tuple(view for record in records for view in self._read_or_skip(record))

    def _read_or_skip(self, record: RenderingRecord) -> tuple[TiledView, ...]:
        try:
            return self._read(record)
        except (Map3dError, OSError) as error:
            status_of(error if isinstance(error, Map3dError) else Map3dError(f"rendering {record.name}: {error}"))
            return ()

    def _read(self, record: RenderingRecord) -> tuple[TiledView, ...]:
        data = read_manifest(self._catalogue.workspace, record)
        known = self._known.pop(record.name, None)
        if data is None:
            return ()
        views = known.views if known is not None and known.data == data else tiled_views(Manifest.load(data, record.name))
        while len(self._known) >= MAX_KNOWN:
            del self._known[next(iter(self._known))]
        self._known[record.name] = _Known(data, views, time.monotonic())
        return views
