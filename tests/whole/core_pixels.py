"""G-buffers of a rendering, computed by the core without tiles, server or browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.catalogue import RenderingRecord, Workspace
from map3d.geometry.frames import PinnedFrame
from map3d.registry import Registry
from map3d.renderings.plan import track_frame
from map3d.tiles.occupancy import xy_from_morton
from map3d.types import TileId

MIN_PIXELS = 400
"""Minimum size of a building to click."""


class VisibleObject(NamedTuple):
    """An object and the world position of one of its pixels, at the pixel's centre."""

    id: int
    name: str
    position: list[float]


class CoreView:
    """One view of a rendering, traced again."""

    def __init__(self, workspace: Path, rendering: str, view: str) -> None:
        catalogue = Workspace(workspace).open_catalogue()
        self.record: RenderingRecord = catalogue.rendering(rendering)
        catalogue.close()
        self.frame: PinnedFrame = next(frame for frame in self.record.frames if frame.id == view)
        self._frame = track_frame(self.record.tracks_of(self.frame)[0])
        self._scene = _core.Scene(str(workspace / "scenes" / self.record.scene))
        self._registry = workspace / "scenes" / self.record.scene / "registry.sqlite"

    def tiles(self) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """Yields (x, y, G-buffer) of every tile of the deepest level that may have content."""
        columns, rows = xy_from_morton(self._scene.occupied(self._frame, self.frame.zmax))
        for y, x in sorted(zip(rows.tolist(), columns.tolist(), strict=True)):
            yield x, y, self._scene.gbuffer(self._frame, x, y)

    def mosaic(self, kind: str) -> NDArray[Any]:
        """Returns the (side, side) array of the whole deepest level; 0 in tiles without content."""
        px = self.record.tile_px
        whole = np.zeros((px << self.frame.zmax, px << self.frame.zmax), np.uint32)
        for x, y, buffer in self.tiles():
            whole[y * px : (y + 1) * px, x * px : (x + 1) * px] = buffer[kind]
        return whole

    def pixel_of(self, position: list[float]) -> tuple[int, int]:
        """Returns (column, row) in the whole deepest level."""
        column, row, _ = self.frame.level_pixel_from_local(self.frame.zmax, np.array(position) - self._scene.origin)
        return int(column), int(row)

    def find_objects(self, kind: str | None, count: int) -> list[VisibleObject]:
        """Returns objects of a class (None: any) with many pixels in one tile, each at the pixel nearest to its middle."""
        found: dict[int, VisibleObject] = {}
        with Registry(self._registry) as registry:
            for x, y, buffer in self.tiles():
                for number in map(int, np.unique(buffer["id"])):
                    item = registry.get(number) if number and number not in found else None
                    rows, columns = np.nonzero(buffer["id"] == number)
                    if item is None or len(rows) < MIN_PIXELS or (kind and item.kind.lower() != kind):
                        continue
                    middle = np.argmin((rows - np.median(rows)) ** 2 + (columns - np.median(columns)) ** 2)
                    j, i = int(rows[middle]), int(columns[middle])
                    local = self.frame.local_from_pixel(TileId(self.frame.zmax, x, y), i, j, buffer["depth"][j, i])
                    found[number] = VisibleObject(number, item.name, (local + self._scene.origin).tolist())
                if len(found) >= count:
                    break
        return list(found.values())[:count]
