"""Hilbert indices, which order the squares of a grid so that consecutive squares share a side."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_LEVEL: Final = 31


def hilbert_indices(level: int, x: ArrayLike, y: ArrayLike) -> NDArray[np.int64]:
    """Returns the numbers along the Hilbert curve of the columns x and rows y of a grid of 2^level × 2^level squares, level ≤ 31.

    Hilbert (1891), computed from the highest bit down: the quadrant, then the rotation of what is in it.
    """
    x, y = np.array(x, np.int64), np.array(y, np.int64)
    numbers = np.zeros(np.broadcast_shapes(x.shape, y.shape), np.int64)
    for bit in range(level - 1, -1, -1):
        right, upper = x >> bit & 1, y >> bit & 1
        numbers = numbers << 2 | (3 * right ^ upper)
        flipped, turned = (right == 1) & (upper == 0), upper == 0
        mask = (1 << bit) - 1
        x, y = np.where(flipped, mask - (x & mask), x & mask), np.where(flipped, mask - (y & mask), y & mask)
        x, y = np.where(turned, y, x), np.where(turned, x, y)
    return numbers
