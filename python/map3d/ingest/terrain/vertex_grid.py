"""The ground as a grid of vertices over a raster: where they lie, how high they are, which belong to which tile.

Grid positions are in the raster's pixels: 0 the left (top) edge, i + ½ the centre of column (row) i. A vertex lies at every centre and on the outer
edge, so that the ground covers what the raster covers. Everything is computed per vertex from its position alone: tiles that share a border share
its bits.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rasterio.windows import Window

from map3d.errors import ImportFailed

GREATEST_HEIGHT_M = 100_000.0
"""Heights beyond are taken for unmarked gaps."""


@dataclass(frozen=True)
class GridTile:
    """Cells [first, last) of the grid; `row` and `column` count tiles from the top left."""

    row: int
    column: int
    first_row: int
    first_column: int
    last_row: int
    last_column: int


class Surface(Protocol):
    """What gives heights at grid positions."""

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """(rows, columns) metres at increasing positions; NaN where there is no ground."""


@dataclass(frozen=True)
class Grid:
    """Positions of the vertices' rows and columns, and the cells of a tile's side."""

    rows: NDArray[np.float64]
    columns: NDArray[np.float64]
    tile_cells: int

    def tiles(self) -> Iterator[GridTile]:
        for row, top in enumerate(range(0, len(self.rows) - 1, self.tile_cells)):
            for column, left in enumerate(range(0, len(self.columns) - 1, self.tile_cells)):
                bottom, right = min(top + self.tile_cells, len(self.rows) - 1), min(left + self.tile_cells, len(self.columns) - 1)
                yield GridTile(row, column, top, left, bottom, right)

    @property
    def tile_count(self) -> int:
        return -(-(len(self.rows) - 1) // self.tile_cells) * -(-(len(self.columns) - 1) // self.tile_cells)

    @property
    def cell_count(self) -> int:
        return (len(self.rows) - 1) * (len(self.columns) - 1)

    def positions(self, tile: GridTile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(rows, columns) of the tile's vertices, both borders included."""
        return self.rows[tile.first_row : tile.last_row + 1], self.columns[tile.first_column : tile.last_column + 1]


def centre_positions(count: int, parts: int = 1) -> NDArray[np.float64]:
    """Edge, centres, edge; each interval cut into `parts`."""
    whole = np.concatenate([[0.0], np.arange(count) + 0.5, [float(count)]])
    if parts == 1:
        return whole
    inner = (whole[:-1, None] + np.diff(whole)[:, None] * np.arange(parts) / parts).ravel()
    return np.append(inner, whole[-1])


def even_positions(count: int, step: float) -> NDArray[np.float64]:
    """From edge to edge in steps, the last one as long as is left."""
    return np.append(np.arange(0.0, count, step), float(count))


@dataclass(frozen=True)
class FlatSurface:
    """Ground of one height."""

    height_m: float

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.full((len(rows), len(columns)), self.height_m)


class RasterSurface:
    """Heights of the first band of a raster, bilinear between pixel centres, constant from the outermost centres to the edge. Reads windows only."""

    def __init__(self, dataset: Any, metres_per_unit: float) -> None:
        self._dataset = dataset
        self._scale = float(dataset.scales[0]) * metres_per_unit
        self._offset = float(dataset.offsets[0]) * metres_per_unit
        self.implausible = 0
        """Heights met beyond ±100 km (each once per tile it is in)."""

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        row, row_part = _centres(rows, self._dataset.height)
        column, column_part = _centres(columns, self._dataset.width)
        data = self._read(int(row[0]), int(row[-1]) + 2, int(column[0]), int(column[-1]) + 2)
        r, c = row - row[0], column - column[0]
        upper = _mix(data[np.ix_(r, c)], data[np.ix_(r, c + 1)], column_part[None, :])
        lower = _mix(data[np.ix_(r + 1, c)], data[np.ix_(r + 1, c + 1)], column_part[None, :])
        return _mix(upper, lower, row_part[:, None])

    def _read(self, top: int, bottom: int, left: int, right: int) -> NDArray[np.float64]:
        """Pixels [top, bottom) × [left, right); beyond the raster the outermost again, which get no weight."""
        height, width = min(bottom, self._dataset.height) - top, min(right, self._dataset.width) - left
        try:
            band = self._dataset.read(1, window=Window(left, top, width, height), masked=True)
        except Exception as error:
            raise ImportFailed(f"{self._dataset.name}: cannot read rows {top} to {bottom}: {error}") from error
        data = np.where(np.ma.getmaskarray(band), np.nan, band.data.astype(np.float64) * self._scale + self._offset)
        with np.errstate(invalid="ignore"):
            wild = np.abs(data) > GREATEST_HEIGHT_M
        self.implausible += int(wild.sum())
        data[wild | ~np.isfinite(data)] = np.nan
        return np.pad(data, ((0, bottom - top - height), (0, right - left - width)), mode="edge")


def _centres(positions: NDArray[np.float64], count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(pixel whose centre is at or before the position, how far towards the next: [0, 1))."""
    along = np.clip(positions - 0.5, 0.0, count - 1.0)
    before = np.floor(along).astype(np.int64)
    return before, along - before


def _mix(near: NDArray[np.float64], far: NDArray[np.float64], part: NDArray[np.float64]) -> NDArray[np.float64]:
    """A height with weight 0 does not count, also when there is none."""
    return np.where(part == 0.0, near, near * (1.0 - part) + far * part)
