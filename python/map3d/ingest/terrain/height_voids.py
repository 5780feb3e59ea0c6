"""Gaps of elevation models that do not declare them: one of the usual values for "no height", far from all other heights."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from rasterio.enums import MaskFlags
from rasterio.windows import Window

from map3d.ingest.terrain.damaged_reads import READ_ERRORS, read_checked

VALUES: Final = (0.0, -9999.0, 9999.0, -32768.0, -32767.0, 32767.0, -99999.0, 99999.0, -999.0)
LEAST_GAP: Final = 50.0
LEAST_SHARE: Final = 0.1
"""All other heights are at least so far away, and by this share of what they differ among themselves."""
ROWS: Final = 256
"""Rows that are looked at."""


class HeightVoids:
    """The values that mean no height in the rasters of a terrain, for all threads: each is found once."""

    def __init__(self) -> None:
        self._found: dict[Path, float | None] = {}

    def of(self, path: Path, dataset: Any) -> float | None:
        """Returns the value of the raster at a path, None if it has none or declares it."""
        if path not in self._found:
            self._found[path] = find_void(dataset)
        return self._found[path]


def find_void(dataset: Any) -> float | None:
    """Returns the value that means no height in the first band of a raster without declared gaps. What cannot be read has none."""
    if dataset.nodata is not None or any(flags != [MaskFlags.all_valid] for flags in dataset.mask_flag_enums):
        return None
    try:
        lines = np.unique(np.linspace(0, dataset.height - 1, min(ROWS, dataset.height)).astype(np.int64))
        values = np.unique([read_checked(dataset, 1, window=Window(0, int(line), dataset.width, 1)) for line in lines]).astype(np.float64)
    except READ_ERRORS:
        return None
    heights = values[np.isfinite(values)]
    return next((value for value in VALUES if _is_apart(value, heights)), None)


def _is_apart(value: float, heights: np.ndarray) -> bool:
    """Whether a value is among the heights, sorted, and far below or above all others."""
    others = heights[~np.isin(heights, VALUES)]
    if len(others) < 2 or value not in heights:
        return False
    low, high = float(others[0]), float(others[-1])
    return max(low - value, value - high) >= max(LEAST_GAP, LEAST_SHARE * (high - low))
