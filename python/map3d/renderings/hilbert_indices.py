"""Hilbert indices: the order in which the base blocks of all views of a rendering are leased (spec/catalogue.md, Jobs)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d.catalogue import RenderingRecord
from map3d.geometry.frames import PinnedFrame
from map3d.geometry.hilbert import hilbert_indices

GROUND_LEVEL: Final = 20
"""The ground has 2^20 × 2^20 squares."""
HILBERT_INDICES: Final = 1 << 2 * GROUND_LEVEL


class HilbertIndices:
    """The ground of a rendering: the horizontal square around the scene's box, or around the part of the box that a window shows, at half the box's
    height."""

    def __init__(self, record: RenderingRecord) -> None:
        low, high = (np.array(corner[:2]) for corner in record.box)
        if (window := record.window) is not None:
            reach_m = window.size_m / min(-frame.axes.forward[2] for frame in record.frames) / 2
            low = np.clip((window.x_m - reach_m, window.y_m - reach_m), low, high)
            high = np.clip((window.x_m + reach_m, window.y_m + reach_m), low, high)
        self._low, self._side_m = low, max(float((high - low).max()), 1.0)
        self._height_m = (record.box[0][2] + record.box[1][2]) / 2

    def of(self, frame: PinnedFrame, z: int, places: NDArray[np.integer]) -> NDArray[np.int64]:
        """Returns the Hilbert indices of tiles of level z, (n, 2) columns and rows: that of the square of the ground that is visible at
        the tile's centre, or of the nearest square where that point lies beside the ground."""
        tile_m = frame.size_m / 2.0**z
        u, v = frame.u0_m + (places[:, 0] + 0.5) * tile_m, frame.v0_m - (places[:, 1] + 0.5) * tile_m
        right, up, forward = frame.axes
        along = (v - up[2] * self._height_m) / forward[2] ** 2
        ground = np.stack([u * right[k] + along * up[k] for k in range(2)], axis=-1)
        squares = np.floor((ground - self._low) / self._side_m * 2.0**GROUND_LEVEL)
        column, row = np.clip(squares, 0, 2**GROUND_LEVEL - 1).astype(np.int64).T
        return hilbert_indices(GROUND_LEVEL, column, row)
