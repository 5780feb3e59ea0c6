"""Which values of a photo are black and white: one rule for photos of bytes, of 10 to 16 bits, and of other numbers (docs/odd-files.md)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rasterio.enums import ColorInterp
from rasterio.windows import Window

from map3d.ingest.terrain.damaged_reads import READ_ERRORS, read_checked
from map3d.ingest.terrain.stored_blocks import StoredBlocks

SAMPLE_PX: Final = 1024
"""Side of the overview that determines the range of values."""

WHOLE_SAMPLE_PX: Final = 1 << 24
"""Rasters with more pixels and no overviews are sampled in windows."""

SAMPLE_WINDOWS: Final = 256
SAMPLE_WINDOW_PX: Final = 64
"""Side of these windows."""

SENSOR_BITS: Final = (10, 11, 12)
BRIGHT: Final = 0.75
"""A photo uses as many bits as its greatest value fills by this share."""
FULL_16_BITS: Final = 1 << 14
"""Greater values need all 16 bits: no sensor has 15."""
BYTES_IN_16_BITS: Final = 257
"""Bytes written as 16 bits are multiples of it."""

Values = NDArray[np.float64]


@dataclass(frozen=True)
class ValueRange:
    """`low` is black, `high` is white. `words`: how they were found, empty for photos of bytes."""

    low: float = 0.0
    high: float = 255.0
    words: str = ""

    @property
    def stretch(self) -> tuple[float, float]:
        return self.low, self.high

    def __str__(self) -> str:
        return f"{self.low:,.6g} to {self.high:,.6g} are shown as black to white: {self.words}"


def find_range(values: Values, *, bits: int = 0, whole_numbers: bool = True) -> ValueRange:
    """Returns the range of a photo that is not of bytes. `values`: a sample; `bits`: those that the file says are used, 0 if it says nothing.

    Values up to 1 or 255 are what they seem. Whole numbers have the range of the bits that the file names, or that the greatest value needs: 16 if it
    is over 16,383 or all are bytes times 257, so that the picture is that of bytes; 10 to 12 if it fills them. Other values are stretched from the
    0.5th to the 99.5th percentile.
    """
    if not len(values):
        return ValueRange()
    low, high = float(values.min()), float(values.max())
    if low >= 0 and high <= 255:
        return ValueRange(0.0, 1.0, "shares of 1") if high <= 1.0 else ValueRange()
    if whole_numbers and low >= 0:
        if 8 < bits <= 16 and high < 2**bits:
            return ValueRange(high=2.0**bits - 1, words=f"{bits} bits, as the file says")
        if high < 1 << 16 and (high >= FULL_16_BITS or not (values % BYTES_IN_16_BITS).any()):
            return ValueRange(high=65_535.0, words="16 bits by the greatest value")
        full = next((2**used - 1 for used in SENSOR_BITS if BRIGHT * (2**used - 1) <= high < 2**used), None)
        if full is not None:
            return ValueRange(high=float(full), words=f"{full.bit_length()} bits by the greatest value")
    black, white = (float(value) for value in np.percentile(values, [0.5, 99.5]))
    return ValueRange(black, white if white > black else black + 1.0, "the 0.5th and the 99.5th percentile")


def significant_bits(dataset: Any, bands: Sequence[int]) -> int:
    """Returns how many bits the file says that its values have, 0 if it says nothing."""
    found = dataset.tags(bands[0], ns="IMAGE_STRUCTURE").get("NBITS", "0")
    return int(found) if found.isascii() and found.isdigit() else 0


def is_whole(dataset: Any, bands: Sequence[int]) -> bool:
    return np.dtype(dataset.dtypes[bands[0] - 1]).kind in "iu"


def sample_values(dataset: Any, count: int) -> Values | None:
    """Returns values of the colour bands, evenly spread, fewer if this is one of `count` photos; None for bytes. What cannot be read is left out."""
    bands = find_colour_bands(dataset)
    if dataset.dtypes[bands[0] - 1] == "uint8":
        return None
    side = max(int(SAMPLE_PX / count**0.5), 16)
    blocks = StoredBlocks(dataset, bands)
    if dataset.width * dataset.height <= WHOLE_SAMPLE_PX or dataset.overviews(bands[0]):
        shape = (min(dataset.height, side), min(dataset.width, side))
        values = _known_values(dataset, bands, Window(0, 0, dataset.width, dataset.height), shape, blocks)
        if values is not None:
            return values
    windows = blocks.spread(max(SAMPLE_WINDOWS // count, 1), SAMPLE_WINDOW_PX)
    parts = [_known_values(dataset, bands, window, (int(window.height), int(window.width)), blocks) for window in windows]
    return np.concatenate([part for part in parts if part is not None] or [np.empty(0)])


def _known_values(dataset: Any, bands: list[int], window: Window, shape: tuple[int, int], blocks: StoredBlocks) -> Values | None:
    """Returns the values of a window, read at `shape`, that are there and finite; None if they cannot be read."""
    try:
        data = read_checked(dataset, bands, window=window, out_shape=(len(bands), *shape), masked=True).astype(np.float64)
    except READ_ERRORS:
        return None
    stored = blocks.mask(window, *shape)
    known = np.ma.masked_invalid(data if stored is None else np.ma.masked_where(np.broadcast_to(~stored, data.shape), data))
    values: Values = known.compressed()
    return values


def find_colour_bands(dataset: Any) -> list[int]:
    """Returns the numbers of the red, green and blue band, declared or by order; or of the single grey band."""
    declared = list(dataset.colorinterp)
    rgb = [declared.index(band) + 1 for band in (ColorInterp.red, ColorInterp.green, ColorInterp.blue) if band in declared]
    if len(rgb) == 3:
        return rgb
    visible = [number for number, band in enumerate(declared, 1) if band is not ColorInterp.alpha]
    return visible[:3] if len(visible) >= 3 else visible[:1]
