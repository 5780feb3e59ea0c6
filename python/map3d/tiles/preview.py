"""Chooses a preview of a rendering: a window of one view that the content fills, and the tiles that it shows."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d.tiles.manifest import Manifest, ManifestView
from map3d.tiles.occupancy import Occupancy
from map3d.types import COLOR_KINDS, Layer, TileId

ASPECT: Final = 1.6
MIN_WIDTH_PX: Final = 640
"""The preview takes the first level at which its window is this wide, unless the caller names another width."""
GRID_LEVELS: Final = range(6, 12)
"""Levels whose occupied tiles may determine the window: the first one at which content has enough columns."""
GRID_COLUMNS: Final = 16
COVERED: Final = 0.98
"""Share of inner cells in a window that content covers."""
SMALLEST_CROP: Final = 0.4
"""Narrowest window, as a share of the widest one."""
CROPPED_M: Final = 300.0
"""Content less wide, such as a single building, is shown whole."""


@dataclass(frozen=True)
class Preview:
    """`layer`: of colours, lit or not; `window`: (left, top, width, height) in pixels of the tiles' level."""

    view: str
    layer: Layer
    window: tuple[float, float, float, float]
    tiles: tuple[TileId, ...]


@dataclass(frozen=True)
class _Window:
    """Centre and size in the unit square of a pyramid; y points down."""

    x: float
    y: float
    width: float
    aspect: float

    @property
    def height(self) -> float:
        return self.width / self.aspect

    def covered_share(self, grid: NDArray[np.bool_]) -> float:
        """Returns the share of occupied cells; cells outside the grid count as empty."""
        side = len(grid)
        columns, rows = (_cells(centre, size, side) for centre, size in ((self.x, self.width), (self.y, self.height)))
        inside = grid[max(rows.start, 0) : rows.stop, max(columns.start, 0) : columns.stop]
        return float(inside.sum()) / (len(rows) * len(columns))


def choose_preview(manifest: Manifest, *, aspect: float = ASPECT, min_width_px: int = MIN_WIDTH_PX) -> Preview | None:
    """Returns None while no tile of a colour layer exists. `aspect`: width divided by height."""
    views = sorted(manifest.views, key=lambda view: view.frame.id != manifest.start_view)
    view = next((view for view in views if view.occupancy.count(0)), None)
    layer = next((layer for layers in manifest.passes for layer in layers if layer.kind in COLOR_KINDS), None)
    if view is None or layer is None:
        return None
    window = _choose_window(_occupied_grid(view.occupancy), aspect, CROPPED_M / view.frame.size_m)
    z = next((z for z in range(manifest.zmax) if window.width * 2**z * manifest.tile_px >= min_width_px), manifest.zmax)
    side_px = 2**z * manifest.tile_px
    pixels = (window.width * side_px, window.height * side_px)
    left, top = window.x * side_px - pixels[0] / 2, window.y * side_px - pixels[1] / 2
    return Preview(view.frame.id, layer, (left, top, *pixels), _find_tiles(view, z, window))


def _occupied_grid(occupancy: Occupancy) -> NDArray[np.bool_]:
    for level in GRID_LEVELS:
        z = min(occupancy.zmax, level)
        columns, rows = (np.array(line, np.int64) for line in zip(*((tile.x, tile.y) for tile in occupancy.tiles(z)), strict=True))
        if z < level or np.ptp(columns) >= GRID_COLUMNS:
            break
    grid = np.zeros((2**z, 2**z), dtype=bool)
    grid[rows, columns] = True
    return grid


def _choose_window(grid: NDArray[np.bool_], aspect: float, least_cropped: float) -> _Window:
    """Returns the largest centred window that content covers. If there is none, and for content less wide than `least_cropped`, returns the window
    that contains all content."""
    rows, columns = (np.flatnonzero(grid.any(axis=axis)) for axis in (1, 0))
    (top, bottom), (left, right) = ((line[0] / len(grid), (line[-1] + 1) / len(grid)) for line in (rows, columns))
    x, y, width, height = (left + right) / 2, (top + bottom) / 2, right - left, bottom - top
    whole = _Window(x, y, max(width, height * aspect), aspect)
    if width < least_cropped:
        return whole
    inner = _erode(grid)
    crops = (_Window(x, y, min(width, height * aspect) * scale, aspect) for scale in np.arange(1.0, SMALLEST_CROP, -0.05))
    return next((crop for crop in crops if crop.covered_share(inner) >= COVERED), whole)


def _erode(grid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Keeps the cells whose eight neighbours are occupied: content may fill the others only partly."""
    padded = np.pad(grid, 1)
    n = len(grid)
    inner = grid.copy()
    for row in range(3):
        for column in range(3):
            inner &= padded[row : row + n, column : column + n]
    return inner


def _find_tiles(view: ManifestView, z: int, window: _Window) -> tuple[TileId, ...]:
    columns, rows = (_cells(centre, size, 2**z) for centre, size in ((window.x, window.width), (window.y, window.height)))
    tiles = (TileId(z, x, y) for y in rows for x in columns)
    return tuple(tile for tile in tiles if tile in view.occupancy)


def _cells(centre: float, size: float, count: int) -> range:
    """Returns the cells of `count` along the unit length that an interval touches."""
    return range(int(np.floor((centre - size / 2) * count + 1e-9)), int(np.ceil((centre + size / 2) * count - 1e-9)))
