"""Heights of a photo without elevation model: the ground between the objects around it."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from map3d.ingest.ground_grid import GroundGrid

if TYPE_CHECKING:
    from map3d.ingest.terrain.terrain_rasters import TerrainRasters


class GroundHeightField:
    """Heights of a ground at grid positions of the photo."""

    def __init__(self, rasters: "TerrainRasters", ground: GroundGrid) -> None:
        self._rasters, self._ground = rasters, ground

    def heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns (rows, columns) metres; NaN where no transformation reaches."""
        x, y = self._places(*np.meshgrid(rows, columns, indexing="ij"))
        return np.where(np.isfinite(x + y), self._ground.at(x, y), np.nan)

    def cells_of(self, pixels: float) -> float:
        """Converts a number of pixels in the middle of the photo to cells of the ground."""
        base = self._rasters.base
        row, column = base.height / 2, base.width / 2
        x, y = self._places(np.array([row, row]), np.array([column, column + 1.0]))
        metres = pixels * float(np.hypot(x[1] - x[0], y[1] - y[0]))
        return metres / self._ground.cell_m if np.isfinite(metres) else 0.0

    def _places(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._rasters.scene_from_base(*self._rasters.georeference.plane_from_pixels(rows, columns))
