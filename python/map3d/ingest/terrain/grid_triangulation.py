"""Triangulates a grid of heights: completely, or with as few triangles as an error bound allows. Grids with a common border share its vertices.

The sparse triangulation is a right-triangulated irregular network (Evans, Kirkpatrick, Townsend 2001): it bisects right triangles at the middle of
their long edge while a height inside differs too much. It keeps all vertices on the border of a grid, so that neighbouring grids match.
"""

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from map3d.errors import BadRequest

Heights = NDArray[np.float64]
"""(rows, columns), metres; NaN in gaps."""

Triangles = NDArray[np.uint32]
"""(t, 3) indices of grid vertices, row · columns + column."""


def triangulate_all(heights: Heights) -> Triangles:
    """Splits each cell along the diagonal with the smaller height difference. A cell that lacks one corner has one triangle, else none."""
    rows, columns = heights.shape
    number = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    tl, tr, bl, br = (grid.ravel() for grid in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    flat = heights.ravel()
    valid = np.isfinite(flat)
    from_top_left = _splits_from_top_left(flat, valid, tl, tr, bl, br)
    pairs = (
        np.where(from_top_left[:, None], np.stack([tl, bl, br], axis=1), np.stack([tl, bl, tr], axis=1)),
        np.where(from_top_left[:, None], np.stack([tl, br, tr], axis=1), np.stack([tr, bl, br], axis=1)),
    )
    triangles = np.stack(pairs, axis=1).reshape(-1, 3)
    complete: Triangles = triangles[valid[triangles].all(axis=1)]
    return complete


def triangulate_sparse(heights: Heights, max_error_m: float) -> Triangles:
    """Keeps every height of the grid within `max_error_m`. Raises BadRequest unless the grid has 2^k + 1 rows and columns."""
    side = heights.shape[0] - 1
    if heights.shape != (side + 1, side + 1) or side.bit_count() != 1:
        raise BadRequest(f"cannot triangulate a grid of shape {heights.shape}: it must have 2^k + 1 rows and columns")
    levels = _bisection_levels(side)
    required = _find_required_vertices(heights, levels, max_error_m)
    kept = []
    active = np.ones(len(levels[0].apex), dtype=bool)
    for level, below in pairwise(levels):
        split = active & required[level.middle]
        kept.append(level.corners(active & ~split))
        active = np.zeros(len(below.apex), dtype=bool)
        active[0::2], active[1::2] = split, split
    kept.append(levels[-1].corners(active))
    triangles = np.concatenate(kept).astype(np.uint32)
    return triangles[np.isfinite(heights.ravel())[triangles].all(axis=1)]


def compact_vertices(triangles: Triangles) -> tuple[NDArray[np.int64], Triangles]:
    """Returns the sorted indices of the used vertices, and the triangles renumbered to them."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    return used.astype(np.int64), renumbered.reshape(-1, 3).astype(np.uint32)


def orient_up(positions: NDArray[np.float64], triangles: Triangles) -> Triangles:
    """Makes every triangle counter-clockwise as seen from above."""
    a, b, c = (positions[triangles[:, k], :2] for k in range(3))
    twice_area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    return np.where((twice_area < 0)[:, None], triangles[:, [0, 2, 1]], triangles)


def _splits_from_top_left(
    flat: Heights, valid: NDArray[np.bool_], tl: NDArray[np.uint32], tr: NDArray[np.uint32], bl: NDArray[np.uint32], br: NDArray[np.uint32]
) -> NDArray[np.bool_]:
    """(cells,) whether to split from top left to bottom right. A cell without one corner is split so that the other three form a triangle."""
    with np.errstate(invalid="ignore"):
        smoother = np.abs(flat[tl] - flat[br]) <= np.abs(flat[tr] - flat[bl])
    return np.where(valid[tl] & valid[br], np.where(valid[tr] & valid[bl], smoother, True), False)


class _BisectionLevel(NamedTuple):
    """Vertex indices of the triangles of one size. `middle` is the midpoint of the long edge from `left` to `right`."""

    left: NDArray[np.int64]
    right: NDArray[np.int64]
    apex: NDArray[np.int64]
    middle: NDArray[np.int64]

    def corners(self, which: NDArray[np.bool_]) -> NDArray[np.int64]:
        return np.stack([self.left[which], self.right[which], self.apex[which]], axis=1)


@lru_cache(maxsize=2)
def _bisection_levels(side: int) -> list[_BisectionLevel]:
    """Returns the levels from the two triangles of the square to those of single cells. Triangle k has children 2k and 2k + 1 on the next level."""
    n = side + 1
    left = np.array([0, n * n - 1])
    right = np.array([n * n - 1, 0])
    apex = np.array([side * n, side])
    levels = []
    for _ in range(2 * side.bit_length() - 1):
        middle = (left + right) // 2
        levels.append(_BisectionLevel(left, right, apex, middle))
        left, right, apex = (_interleave(a, b) for a, b in ((apex, right), (left, apex), (middle, middle)))
    return levels


def _interleave(first: NDArray[np.int64], second: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.stack([first, second], axis=1).ravel()


def _find_required_vertices(heights: Heights, levels: list[_BisectionLevel], max_error_m: float) -> NDArray[np.bool_]:
    """(vertices,) whether the triangulation needs a vertex: for its error bound, on the border, at a gap, or for a smaller triangle.

    The error at the middle of a triangle plus the greater error of its two halves bounds the error of the triangle.
    """
    flat = heights.ravel()
    valid = np.isfinite(flat)
    required = _border(heights.shape[0]) & valid
    bound = np.zeros(len(levels[-1].apex))
    for level, below in zip(levels[-2::-1], levels[:0:-1], strict=True):
        bound = _midpoint_error(flat, valid, level) + np.maximum(bound[0::2], bound[1::2])
        need = bound > max_error_m
        if below is not levels[-1]:
            child = required[below.middle]
            need |= child[0::2] | child[1::2]
        required[level.middle[need]] = True
    return required


def _midpoint_error(flat: Heights, valid: NDArray[np.bool_], level: _BisectionLevel) -> Heights:
    """(triangles,) height difference between the midpoint and the long edge; 0 inside a gap, infinite at its edge."""
    ends = valid[level.left].astype(np.int8) + valid[level.right] + valid[level.middle]
    error = np.abs(flat[level.middle] - (flat[level.left] + flat[level.right]) / 2)
    return np.where(ends == 3, error, np.where(ends == 0, 0.0, np.inf))


def _border(n: int) -> NDArray[np.bool_]:
    border = np.zeros((n, n), dtype=bool)
    border[[0, -1], :] = True
    border[:, [0, -1]] = True
    return border.ravel()
