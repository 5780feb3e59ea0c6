"""What the core itself sees of a rendering: its G-buffers, without tiles, server or browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.catalogue import RenderingRecord, Workspace
from map3d.geometry.frames import PinnedFrame
from map3d.registry import Registry
from map3d.renderings.plan import frame_text
from map3d.types import TileId

LEAST_PIXELS = 400
"""Of a building that is clicked at."""


class Known(NamedTuple):
    """An object that the core sees at a world position, which is a pixel's centre."""

    id: int
    name: str
    position: list[float]


class CoreView:
    """One view of a rendering, traced anew."""

    def __init__(self, workspace: Path, rendering: str, view: str) -> None:
        catalogue = Workspace(workspace).open_catalogue()
        self.record: RenderingRecord = catalogue.rendering(rendering)
        catalogue.close()
        self.frame: PinnedFrame = next(frame for frame in self.record.frames if frame.id == view)
        self._text = frame_text(self.record.tracks_of(self.frame)[0])
        self._scene = _core.Scene(str(workspace / "scenes" / self.record.scene))
        self._registry = workspace / "scenes" / self.record.scene / "registry.sqlite"

    def tiles(self) -> Iterator[tuple[int, int, dict[str, NDArray[Any]]]]:
        """(x, y, G-buffer) of every tile of the deepest level that may hold something."""
        for y, x in np.argwhere(self._scene.occupied(self._text, self.frame.zmax)):
            yield int(x), int(y), self._scene.gbuffer(self._text, int(x), int(y))

    def mosaic(self, kind: str) -> NDArray[Any]:
        """(side, side) of all tiles of the deepest level; 0 where nothing can be."""
        px = self.record.tile_px
        whole = np.zeros((px << self.frame.zmax, px << self.frame.zmax), np.uint32)
        for x, y, buffer in self.tiles():
            whole[y * px : (y + 1) * px, x * px : (x + 1) * px] = buffer[kind]
        return whole

    def pixel_of(self, position: list[float]) -> tuple[int, int]:
        """(column, row) of the whole deepest level."""
        column, row, _ = self.frame.level_pixel_from_local(self.frame.zmax, np.array(position) - self._scene.origin)
        return int(column), int(row)

    def known(self, kind: str | None, count: int) -> list[Known]:
        """Objects of a class with many pixels in one tile, each at the pixel nearest to their middle. None: any class."""
        found: dict[int, Known] = {}
        with Registry(self._registry) as registry:
            for x, y, buffer in self.tiles():
                for number in map(int, np.unique(buffer["id"])):
                    item = registry.get(number) if number and number not in found else None
                    rows, columns = np.nonzero(buffer["id"] == number)
                    if item is None or len(rows) < LEAST_PIXELS or (kind and item.kind.lower() != kind):
                        continue
                    middle = np.argmin((rows - np.median(rows)) ** 2 + (columns - np.median(columns)) ** 2)
                    j, i = int(rows[middle]), int(columns[middle])
                    local = self.frame.local_from_pixel(TileId(self.frame.zmax, x, y), i, j, buffer["depth"][j, i])
                    found[number] = Known(number, item.name, (local + self._scene.origin).tolist())
                if len(found) >= count:
                    break
        return list(found.values())[:count]
