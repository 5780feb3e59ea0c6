"""The blocks of a sparse GeoTIFF that are in the file: the others have no pixel, and reading them would take as long as if they had."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rasterio.windows import Window

Mask = NDArray[np.bool_]
_DRIVER: Final = "GTiff"
MAX_CHECKED: Final = 1 << 16
"""Blocks of a window that are looked up; a window of more counts as stored."""

MAX_LISTED: Final = 1 << 20
"""Blocks that are looked up to find stored ones."""

MAX_PARTS: Final = 64
"""Windows in one block."""

SPREAD: Final = (0.7548776662466927, 0.5698402909980532)
"""Multiples of these, modulo 1, fill the unit square evenly (Roberts 2018)."""


class StoredBlocks:
    """Looks up the blocks of a dataset. `bands`: those that are read; a block is there if it is there in one of them."""

    def __init__(self, dataset: Any, bands: list[int]) -> None:
        self._size = (dataset.height, dataset.width)
        self._dataset = dataset if getattr(dataset, "driver", None) == _DRIVER else None
        if self._dataset is not None:
            self._height, self._width = dataset.block_shapes[bands[0] - 1]
            self._bands = bands

    def mask(self, window: Window, rows: int, columns: int) -> Mask | None:
        """Returns the (rows, columns) mask of pixels in stored blocks, for a window read at that size; None if all blocks are stored."""
        if self._dataset is None:
            return None
        down = range(int(window.row_off) // self._height, -(-int(window.row_off + window.height) // self._height))
        across = range(int(window.col_off) // self._width, -(-int(window.col_off + window.width) // self._width))
        if len(down) * len(across) > MAX_CHECKED:
            return None
        stored = np.array([[self._is_stored(row, column) for column in across] for row in down])
        if stored.all():
            return None
        if not stored.any():
            return np.zeros((rows, columns), dtype=bool)
        row_of = _block_numbers(window.row_off, window.height, rows, self._height) - down.start
        column_of = _block_numbers(window.col_off, window.width, columns, self._width) - across.start
        mask: Mask = stored[np.ix_(row_of, column_of)]
        return mask

    def spread(self, most: int, side: int) -> list[Window]:
        """Returns about `most` windows of up to `side` pixels squared in stored blocks that are spread over the raster; at least one."""
        height, width = (self._height, self._width) if self._dataset is not None else (side, side)
        down, across = -(-self._size[0] // height), -(-self._size[1] // width)
        listed = range(0, down * across, -(-down * across // MAX_LISTED))
        stored = [number for number in listed if self._dataset is None or self._is_stored(*divmod(number, across))] or [0]
        chosen = stored[:: -(-len(stored) // most)]
        each = min(most // len(chosen), MAX_PARTS)
        blocks = [Window(number % across * width, number // across * height, width, height) for number in chosen]
        return [self._part(block, side, k * each + part) for k, block in enumerate(blocks) for part in range(each)]

    def _part(self, block: Window, side: int, number: int) -> Window:
        """Returns a part of a block, which may be as wide as the raster; parts of successive numbers are spread evenly."""
        height, width = min(block.height, self._size[0] - block.row_off), min(block.width, self._size[1] - block.col_off)
        rows, columns = min(height, side), min(width, side)
        right, down = (int(free * (number * step % 1.0)) for free, step in ((width - columns + 1, SPREAD[0]), (height - rows + 1, SPREAD[1])))
        return Window(block.col_off + right, block.row_off + down, columns, rows)

    def _is_stored(self, row: int, column: int) -> bool:
        assert self._dataset is not None, "only the blocks of a GeoTIFF are looked up"
        return any(self._dataset.get_tag_item(f"BLOCK_OFFSET_{column}_{row}", "TIFF", bidx=band) is not None for band in self._bands)


def _block_numbers(first: float, size: float, count: int, block: int) -> NDArray[np.intp]:
    """Returns the block of the centre of each of `count` equal parts of `size` pixels."""
    return ((first + (np.arange(count) + 0.5) * (size / count)) // block).astype(np.intp)
