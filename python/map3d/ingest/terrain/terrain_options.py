"""Options of a terrain import."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from map3d.errors import BadRequest
from map3d.ingest.ground_grid import GroundGrid

MAX_WORKERS: Final = 256


@dataclass(frozen=True)
class TerrainOptions:
    """`max_error_m`: greatest height error of the triangles, 0 keeps every height. `height_m`: height of flat terrain without an elevation model;
    `ground_grid`: heights in place of that. `height_unit_m`: metres per unit of the elevation model; None takes the unit from the file, else metres.
    `ground`: sRGB colour in gaps of the photo. `crs`: overrides the CRS of both rasters, or supplies a missing one; "local" for plain metres.
    `workers`: threads; the asset does not depend on their number. `ranks`: of kinds of rasters; of several at one place, one of the lowest is on top.
    `strict`: the first raster that cannot be read as a whole raises ImportFailed."""

    name: str = "terrain"
    max_error_m: float = 0.0
    tile_cells: int = 256
    texture_px: int = 2048
    height_m: float = 0.0
    ground_grid: GroundGrid | None = None
    height_unit_m: float | None = None
    ground: tuple[int, int, int] = (146, 146, 136)
    crs: str | None = None
    workers: int = 1
    ranks: Mapping[Path, int] = field(default_factory=dict)
    strict: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.max_error_m) and self.max_error_m >= 0):
            raise BadRequest(f"greatest height error {self.max_error_m} m is out of range; give 0 or more")
        if not (1 <= self.tile_cells <= 2048 and self.tile_cells.bit_count() == 1):
            raise BadRequest(f"{self.tile_cells} cells per tile side is out of range; give a power of two from 1 to 2,048")
        if not 128 <= self.texture_px <= 16_384:
            raise BadRequest(f"texture size {self.texture_px} px is out of range; give 128 to 16,384")
        if not np.isfinite(self.height_m):
            raise BadRequest(f"terrain height {self.height_m} m is not finite; give a number")
        if not 1 <= self.workers <= MAX_WORKERS:
            raise BadRequest(f"{self.workers} workers is out of range; give 1 to {MAX_WORKERS}")
