"""Triangles over a grid of heights: all of them, or as few as a greatest error allows. Grids that share a border share its vertices exactly.

The sparse triangulation is a right-triangulated irregular network (Evans, Kirkpatrick, Townsend 2001): right triangles are halved at the middle of
their long edge while a height within differs too much. The border of a grid is kept whole, so that neighbours fit without knowing of each other.
"""

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from map3d.errors import BadRequest

Heights = NDArray[np.float64]
"""(rows, columns), metres; NaN where there is no ground."""

Triangles = NDArray[np.uint32]
"""(t, 3) numbers of grid vertices, row · columns + column."""


def all_triangles(heights: Heights) -> Triangles:
    """Two triangles a cell, along the diagonal with the smaller step; one where a corner is missing, none where two are."""
    rows, columns = heights.shape
    number = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    tl, tr, bl, br = (grid.ravel() for grid in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    flat = heights.ravel()
    there = np.isfinite(flat)
    falling = _prefers_falling(flat, there, tl, tr, bl, br)
    pairs = (
        np.where(falling[:, None], np.stack([tl, bl, br], axis=1), np.stack([tl, bl, tr], axis=1)),
        np.where(falling[:, None], np.stack([tl, br, tr], axis=1), np.stack([tr, bl, br], axis=1)),
    )
    triangles = np.stack(pairs, axis=1).reshape(-1, 3)
    whole: Triangles = triangles[there[triangles].all(axis=1)]
    return whole


def few_triangles(heights: Heights, max_error_m: float) -> Triangles:
    """Triangles from which no height of the grid differs by more than `max_error_m`. The grid has 2^k + 1 rows and columns."""
    side = heights.shape[0] - 1
    if heights.shape != (side + 1, side + 1) or side.bit_count() != 1:
        raise BadRequest(f"a grid of {heights.shape}: must have 2^k + 1 rows and columns")
    levels = _hierarchy(side)
    wanted = _wanted(heights, levels, max_error_m)
    taken = []
    active = np.ones(len(levels[0].apex), dtype=bool)
    for level, below in pairwise(levels):
        split = active & wanted[level.middle]
        taken.append(level.corners(active & ~split))
        active = np.zeros(len(below.apex), dtype=bool)
        active[0::2], active[1::2] = split, split
    taken.append(levels[-1].corners(active))
    triangles = np.concatenate(taken).astype(np.uint32)
    return triangles[np.isfinite(heights.ravel())[triangles].all(axis=1)]


def used_vertices(triangles: Triangles) -> tuple[NDArray[np.int64], Triangles]:
    """(numbers of the vertices used, sorted; the triangles over those)."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    return used.astype(np.int64), renumbered.reshape(-1, 3).astype(np.uint32)


def facing_up(positions: NDArray[np.float64], triangles: Triangles) -> Triangles:
    """The same triangles, each counter-clockwise as seen from above."""
    a, b, c = (positions[triangles[:, k], :2] for k in range(3))
    twice_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.where((twice_area < 0)[:, None], triangles[:, [0, 2, 1]], triangles)


def _prefers_falling(
    flat: Heights, there: NDArray[np.bool_], tl: NDArray[np.uint32], tr: NDArray[np.uint32], bl: NDArray[np.uint32], br: NDArray[np.uint32]
) -> NDArray[np.bool_]:
    """Whether to cut from top left to bottom right. A cell that misses a corner is cut so that the other three stay together."""
    with np.errstate(invalid="ignore"):
        smoother = np.abs(flat[tl] - flat[br]) <= np.abs(flat[tr] - flat[bl])
    return np.where(there[tl] & there[br], np.where(there[tr] & there[bl], smoother, True), False)


class _Level(NamedTuple):
    """Triangles of one size: numbers of their vertices. The long edge runs from `left` to `right`, `middle` is its middle."""

    left: NDArray[np.int64]
    right: NDArray[np.int64]
    apex: NDArray[np.int64]
    middle: NDArray[np.int64]

    def corners(self, which: NDArray[np.bool_]) -> NDArray[np.int64]:
        return np.stack([self.left[which], self.right[which], self.apex[which]], axis=1)


@lru_cache(maxsize=2)
def _hierarchy(side: int) -> list[_Level]:
    """From the two triangles of the square to those of single cells; the children of triangle k are 2k and 2k + 1 of the next level."""
    n = side + 1
    left = np.array([0, n * n - 1])
    right = np.array([n * n - 1, 0])
    apex = np.array([side * n, side])
    levels = []
    for _ in range(2 * side.bit_length() - 1):
        middle = (left + right) // 2
        levels.append(_Level(left, right, apex, middle))
        left, right, apex = (_interleave(a, b) for a, b in ((apex, right), (left, apex), (middle, middle)))
    return levels


def _interleave(first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.stack([first, second], axis=1).ravel()


def _wanted(heights: Heights, levels: list[_Level], max_error_m: float) -> NDArray[np.bool_]:
    """(vertices,) whether a vertex must be there: for the error without it, at the border or the rim of a gap, or for one of a smaller triangle.

    A triangle that is not halved errs at its middle, and its halves err by that and by what they err themselves: the sum bounds it.
    """
    flat = heights.ravel()
    there = np.isfinite(flat)
    wanted = _border(heights.shape[0]) & there
    bound = np.zeros(len(levels[-1].apex))
    for level, below in zip(levels[-2::-1], levels[:0:-1], strict=True):
        bound = _own_error(flat, there, level) + np.maximum(bound[0::2], bound[1::2])
        need = bound > max_error_m
        if below is not levels[-1]:
            child = wanted[below.middle]
            need |= child[0::2] | child[1::2]
        wanted[level.middle[need]] = True
    return wanted


def _own_error(flat: Heights, there: NDArray[np.bool_], level: _Level) -> Heights:
    """(triangles,) between the middle's height and the long edge; none in a gap, endless at its rim."""
    ends = there[level.left].astype(np.int8) + there[level.right] + there[level.middle]
    error = np.abs(flat[level.middle] - (flat[level.left] + flat[level.right]) / 2)
    return np.where(ends == 3, error, np.where(ends == 0, 0.0, np.inf))


def _border(n: int) -> NDArray[np.bool_]:
    border = np.zeros((n, n), dtype=bool)
    border[[0, -1], :] = True
    border[:, [0, -1]] = True
    return border.ravel()
