"""Terrain as a grid of vertices over a raster: their positions, heights and tiles.

Grid positions are in pixels of the raster: 0 is the left (top) edge, i + ½ the centre of column (row) i. Vertices are at all centres and on the outer
edge, so that the terrain covers the whole raster. Each vertex is computed from its position alone: tiles that share a border agree bit by bit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from rasterio.windows import Window

from map3d.ingest.terrain.damaged_reads import Damage, read_checked, read_parts

MAX_HEIGHT_M = 100_000.0
"""Greater absolute heights count as unmarked gaps."""


@dataclass(frozen=True)
class GridTile:
    """Cells [first, last) of the grid; `row` and `column` count tiles from the top left."""

    row: int
    column: int
    first_row: int
    first_column: int
    last_row: int
    last_column: int


class HeightField(Protocol):
    """Gives heights at grid positions."""

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns (rows, columns) metres at increasing positions; NaN in gaps."""


@dataclass(frozen=True)
class VertexGrid:
    """Grid positions of the vertices, and the number of cells along a tile's side."""

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
        """Returns the rows and columns of the tile's vertices, including both borders."""
        return self.rows[tile.first_row : tile.last_row + 1], self.columns[tile.first_column : tile.last_column + 1]


def pixel_centre_positions(count: int, parts: int = 1) -> NDArray[np.float64]:
    """Returns edge, centres, edge, with each interval split into `parts`."""
    positions = np.concatenate([[0.0], np.arange(count) + 0.5, [float(count)]])
    if parts == 1:
        return positions
    inner = (positions[:-1, None] + np.diff(positions)[:, None] * np.arange(parts) / parts).ravel()
    return np.append(inner, positions[-1])


def regular_positions(count: int, step: float) -> NDArray[np.float64]:
    """Returns positions from edge to edge in equal steps; the last step may be shorter."""
    return np.append(np.arange(0.0, count, step), float(count))


@dataclass(frozen=True)
class ConstantHeightField:
    """The same height everywhere."""

    height_m: float

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.full((len(rows), len(columns)), self.height_m)


class RasterHeightField:
    """Heights of a raster's first band: bilinear between pixel centres, constant from the outermost centres to the edge. Reads windows only."""

    def __init__(
        self,
        dataset: Any,
        metres_per_unit: float,
        scale: tuple[float, float] | None = None,
        damage: Damage | None = None,
        void: float | None = None,
    ) -> None:
        """`scale`: metres per value and metres of the value 0; None takes them from the dataset. `damage` gets the name of a raster that cannot
        be read as a whole; `void`: the value that means no height, besides declared ones."""
        self._dataset, self._damage, self._void = dataset, damage or Damage(strict=True), void
        self._scale = scale or (float(dataset.scales[0]) * metres_per_unit, float(dataset.offsets[0]) * metres_per_unit)
        self.implausible = 0
        """Number of heights beyond ±100 km, counted once per tile."""

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        row, row_part = _locate(rows, self._dataset.height)
        column, column_part = _locate(columns, self._dataset.width)
        data = self._read(int(row[0]), int(row[-1]) + 2, int(column[0]), int(column[-1]) + 2)
        r, c = row - row[0], column - column[0]
        upper = _interpolate(data[np.ix_(r, c)], data[np.ix_(r, c + 1)], column_part[None, :])
        lower = _interpolate(data[np.ix_(r + 1, c)], data[np.ix_(r + 1, c + 1)], column_part[None, :])
        return _interpolate(upper, lower, row_part[:, None])

    def _read(self, top: int, bottom: int, left: int, right: int) -> NDArray[np.float64]:
        """Reads pixels [top, bottom) × [left, right). Beyond the raster it repeats the outermost pixels, whose weight is 0."""
        height, width = min(bottom, self._dataset.height) - top, min(right, self._dataset.width) - left
        data = self._read_window(Window(left, top, width, height))
        return np.pad(data, ((0, bottom - top - height), (0, right - left - width)), mode="edge")

    def _read_window(self, window: Window) -> NDArray[np.float64]:
        """Returns metres; NaN in gaps."""
        data, implausible = read_metres(self._dataset, window, self._scale, self._damage, str(self._dataset.name), self._void)
        self.implausible += implausible
        return data


def read_metres(
    dataset: Any, window: Window, scale: tuple[float, float], damage: Damage, name: str, void: float | None = None
) -> tuple[NDArray[np.float64], int]:
    """Returns the heights of a window in metres, NaN in gaps, at the value `void` and where the raster `name` cannot be read, and the number of
    implausible ones."""
    data = np.full((int(window.height), int(window.width)), np.nan)

    def read(part: Window, _rows: int) -> Any:
        return read_checked(dataset, 1, window=part, masked=True)

    for rows, band in read_parts(window, int(window.height), dataset.block_shapes[0][0], read, partial(damage.add, name)):
        data[rows] = np.where(np.ma.getmaskarray(band) | (band.data == void), np.nan, band.data.astype(np.float64) * scale[0] + scale[1])
    with np.errstate(invalid="ignore"):
        implausible = np.abs(data) > MAX_HEIGHT_M
    data[implausible | ~np.isfinite(data)] = np.nan
    return data, int(implausible.sum())


def _locate(positions: NDArray[np.float64], count: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Returns the pixel whose centre is at or before each position, and the fraction [0, 1) towards the next centre."""
    along = np.clip(positions - 0.5, 0.0, count - 1.0)
    before = np.floor(along).astype(np.int64)
    return before, along - before


def _interpolate(near: NDArray[np.float64], far: NDArray[np.float64], part: NDArray[np.float64]) -> NDArray[np.float64]:
    """A height with weight 0 does not count, even if it is NaN."""
    return np.where(part == 0.0, near, near * (1.0 - part) + far * part)
