"""Reading of rasters that may be cut off or damaged: what can be read is used, the rest is a gap, and the raster is named."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, Final

import numpy as np
from rasterio._err import CPLE_BaseError, CPLE_OutOfMemoryError
from rasterio.errors import RasterioError
from rasterio.windows import Window

from map3d.errors import ImportFailed

MAX_PARTS: Final = 16
"""Into how many parts a window is divided that cannot be read as a whole."""

_MAX_OLD_ERRORS: Final = 8
READ_ERRORS: Final = (RasterioError, CPLE_BaseError, OSError, ValueError)
"""What reading a damaged raster raises."""


def read_checked(dataset: Any, *bands: Any, **options: Any) -> Any:
    """Reads like `dataset.read`. After an error, the next call on the dataset raises none of the old ones."""
    return _checked(dataset, dataset.read, *bands, **options)


def read_mask(dataset: Any, **options: Any) -> Any:
    """Reads like `dataset.dataset_mask`, with errors as of `read_checked`."""
    return _checked(dataset, dataset.dataset_mask, **options)


def _checked(dataset: Any, read: Callable[..., Any], *bands: Any, **options: Any) -> Any:
    try:
        return read(*bands, **options)
    except READ_ERRORS:
        for _ in range(_MAX_OLD_ERRORS):
            with suppress(*READ_ERRORS):
                _ = dataset.colorinterp
                break
        raise


class Damage:
    """Collects the rasters that cannot be read as a whole; for one thread."""

    def __init__(self, *, strict: bool = False) -> None:
        """`strict`: the first one raises ImportFailed."""
        self._strict = strict
        self.names: set[str] = set()

    def add(self, name: str, window: Window, error: Exception) -> None:
        if self._strict:
            raise ImportFailed(f"{name}: cannot read {window}; the file may be damaged: {error}") from error
        self.names.add(name)


def read_parts(
    window: Window, rows: int, block_rows: int, read: Callable[[Window, int], Any], failed: Callable[[Window, Exception], None]
) -> Iterator[tuple[slice, Any]]:
    """Yields the rows of a window, read into `rows` rows, and what `read` returns for them: all at once or, where that fails, in parts of whole
    blocks. Parts that fail are told to `failed`. `read`: (window, number of rows) → array."""
    try:
        yield slice(0, rows), read(window, rows)
        return
    except READ_ERRORS as error:
        _raise_out_of_memory(error)
        if window.height <= block_rows or rows == 1:
            failed(window, error)
            return
    step = block_rows * max(1, -(-int(window.height) // (MAX_PARTS * block_rows)))
    starts = [int(window.row_off), *range((int(window.row_off) // step + 1) * step, int(window.row_off + window.height), step)]
    ends = [*starts[1:], int(window.row_off + window.height)]
    edges = np.rint((np.array([*starts, ends[-1]]) - window.row_off) * (rows / window.height)).astype(int)
    for start, end, first, last in zip(starts, ends, edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = Window(window.col_off, start, window.width, end - start)
        if last > first:
            try:
                yield slice(first, last), read(part, last - first)
            except READ_ERRORS as error:
                _raise_out_of_memory(error)
                failed(part, error)


def _raise_out_of_memory(error: Exception) -> None:
    """Raises an error that says nothing about the file."""
    if isinstance(error, CPLE_OutOfMemoryError) or isinstance(error.__cause__, CPLE_OutOfMemoryError):
        raise error
