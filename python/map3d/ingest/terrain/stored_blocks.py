"""The blocks of a sparse GeoTIFF that are in the file: the others have no pixel, and reading them would take as long as if they had."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rasterio.windows import Window

Mask = NDArray[np.bool_]
_DRIVER: Final = "GTiff"
MAX_CHECKED: Final = 1 << 16
"""Blocks of a window that are looked up; a window of more counts as stored."""


class StoredBlocks:
    """Looks up the blocks of a dataset. `bands`: those that are read; a block is there if it is there in one of them."""

    def __init__(self, dataset: Any, bands: list[int]) -> None:
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

    def _is_stored(self, row: int, column: int) -> bool:
        assert self._dataset is not None, "only the blocks of a GeoTIFF are looked up"
        return any(self._dataset.get_tag_item(f"BLOCK_OFFSET_{column}_{row}", "TIFF", bidx=band) is not None for band in self._bands)


def _block_numbers(first: float, size: float, count: int, block: int) -> NDArray[np.intp]:
    """Returns the block of the centre of each of `count` equal parts of `size` pixels."""
    return ((first + (np.arange(count) + 0.5) * (size / count)) // block).astype(np.intp)
