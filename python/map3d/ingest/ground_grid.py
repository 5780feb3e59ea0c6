"""The ground where no elevation model says how high it is: heights between the bases of the objects that stand on it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

CELL_M: Final = 25.0
MAX_CELLS: Final = 128
"""Cells along the longer side; of larger towns, cells are larger."""

STRAY_M: Final = 50.0
STRAY_DEVIATIONS: Final = 8.0
"""Bases farther from the median than both are no ground."""

SMOOTHINGS: Final = 48
BEYOND_M: Final = 100_000.0
STEP_M: Final = 0.25
"""Heights are multiples of this, so that small changes of a town do not change its ground."""

Heights = NDArray[np.float64]


@dataclass(frozen=True)
class GroundGrid:
    """`heights`: (rows, columns) metres at the centres of cells; row 0 is the southernmost. `x`, `y`: of the first centre, world coordinates."""

    x: float
    y: float
    cell_m: float
    heights: Heights

    @classmethod
    def of_bases(cls, bases: Heights) -> Self | None:
        """Takes (n, 3) world coordinates of points on the ground; or None. A few points far from the others, in plan or in height,
        do not count."""
        kept = _without_strays(bases[np.isfinite(bases).all(axis=1)])
        if not len(kept):
            return None
        low, high = kept[:, :2].min(axis=0), kept[:, :2].max(axis=0)
        cell_m = max(CELL_M, float((high - low).max()) / (MAX_CELLS - 1))
        x, y = (float(np.floor(value / cell_m) * cell_m) for value in low)
        columns, rows = (int((end - start) // cell_m) + 1 for start, end in ((x, high[0]), (y, high[1])))
        column, row = ((kept[:, k] - start) // cell_m for k, start in ((0, x), (1, y)))
        known = _cell_medians(row.astype(np.int64) * columns + column.astype(np.int64), kept[:, 2], rows * columns).reshape(rows, columns)
        heights = np.round(_fill(known) / STEP_M) * STEP_M
        return cls(x + cell_m / 2, y + cell_m / 2, cell_m, heights)

    def at(self, x: Heights, y: Heights) -> Heights:
        """Returns the heights at points of any shape; beyond the grid, those of its edge."""
        row, column = self._index(y, self.y, self.heights.shape[0]), self._index(x, self.x, self.heights.shape[1])
        r, c = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
        r2, c2 = np.minimum(r + 1, self.heights.shape[0] - 1), np.minimum(c + 1, self.heights.shape[1] - 1)
        part_r, part_c = row - r, column - c
        lower = self.heights[r, c] * (1 - part_c) + self.heights[r, c2] * part_c
        upper = self.heights[r2, c] * (1 - part_c) + self.heights[r2, c2] * part_c
        found: Heights = lower * (1 - part_r) + upper * part_r
        return found

    def mesh(self) -> tuple[Heights, NDArray[np.uint32]]:
        """Returns (n, 3) positions and (t, 3) triangles of the ground, far beyond the grid."""
        heights = np.pad(self.heights, 1, mode="edge")
        rows, columns = heights.shape
        xs, ys = (_with_ends(start, self.cell_m, count) for start, count in ((self.x, columns), (self.y, rows)))
        positions = np.column_stack([np.tile(xs, rows), np.repeat(ys, columns), heights.ravel()])
        corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)[None, :]).ravel()
        first = np.column_stack([corner, corner + 1, corner + columns + 1])
        second = np.column_stack([corner, corner + columns + 1, corner + columns])
        return positions, np.concatenate([first, second]).astype(np.uint32)

    @property
    def document(self) -> dict[str, Any]:
        """The grid as JSON."""
        return {"x": self.x, "y": self.y, "cell_m": self.cell_m, "heights": self.heights.tolist()}

    @classmethod
    def load(cls, document: Mapping[str, Any]) -> Self:
        return cls(document["x"], document["y"], document["cell_m"], np.array(document["heights"], dtype=np.float64))

    @property
    def digest(self) -> str:
        return hashlib.sha256(json.dumps(self.document, sort_keys=True).encode()).hexdigest()[:32]

    def _index(self, value: Heights, start: float, count: int) -> Heights:
        clipped: Heights = np.clip(np.nan_to_num((value - start) / self.cell_m), 0, count - 1)
        return clipped


def _with_ends(start: float, cell_m: float, count: int) -> Heights:
    """Returns the coordinates of `count` lines, of which the outermost lie far away."""
    lines: Heights = np.arange(-1.0, count - 1.0) * cell_m + start
    lines[0], lines[-1] = lines[0] - BEYOND_M, lines[-1] + BEYOND_M
    return lines


def _without_strays(bases: Heights) -> Heights:
    """Leaves out points far from the middle half of all in plan, and far from the median in height."""
    if len(bases) < 3:
        return bases
    lower, middle, upper = np.quantile(bases, (0.25, 0.5, 0.75), axis=0)
    reach = np.maximum(10 * (upper - lower), 2_000.0)
    near = (np.abs(bases - middle)[:, :2] <= reach[:2]).all(axis=1)
    deviation = 1.4826 * float(np.median(np.abs(bases[:, 2] - middle[2])))
    found: Heights = bases[near & (np.abs(bases[:, 2] - middle[2]) <= max(STRAY_M, STRAY_DEVIATIONS * deviation))]
    return found


def _cell_medians(cells: NDArray[np.int64], heights: Heights, count: int) -> Heights:
    """Returns (count,) the lower median of the heights in each cell; NaN in empty cells."""
    order = np.lexsort((heights, cells))
    cells, heights = cells[order], heights[order]
    numbers, starts, counts = np.unique(cells, return_index=True, return_counts=True)
    medians = np.full(count, np.nan)
    medians[numbers] = heights[starts + (counts - 1) // 2]
    return medians


def _fill(known: Heights) -> Heights:
    """Fills cells without height from coarser grids, and smooths what it filled; known cells stay."""
    filled = _pull(known)
    unknown = np.isnan(known)
    for _ in range(SMOOTHINGS if unknown.any() else 0):
        padded = np.pad(filled, 1, mode="edge")
        around = (padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:]) / 4
        filled = np.where(unknown, around, known)
    return filled


def _pull(known: Heights) -> Heights:
    """Returns the grid with the values of the finest coarser cell that has any."""
    if not np.isnan(known).any():
        return known
    rows, columns = known.shape
    padded = np.pad(known, ((0, rows % 2), (0, columns % 2)), constant_values=np.nan)
    blocks = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2)
    counts = np.isfinite(blocks).sum(axis=(1, 3))
    coarse = np.where(counts > 0, np.nansum(blocks, axis=(1, 3)) / np.maximum(counts, 1), np.nan)
    above = np.repeat(np.repeat(_pull(coarse), 2, axis=0), 2, axis=1)[:rows, :columns]
    return np.where(np.isnan(known), above, known)
