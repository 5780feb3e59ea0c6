"""Hypsometric colours: terrain without a photo is coloured by its height, from green through sand and brown to pale grey."""

import io
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d.ingest.terrain.vertex_grid import GridTile, HeightField, VertexGrid

COLOURS: Final = (
    (0.0, (150, 182, 140)),
    (0.2, (190, 206, 160)),
    (0.4, (229, 221, 181)),
    (0.6, (214, 188, 150)),
    (0.8, (190, 160, 132)),
    (1.0, (233, 228, 222)),
)
"""Part of the range of heights, sRGB."""
LEAST_RANGE_M: Final = 20.0
"""Flat terrain stays green."""
BEYOND: Final = 0.005
"""Part of the sampled heights that may lie beyond either end of the range."""

_SIZE_PX: Final = (256, 4)
_SAMPLED_TILES: Final = 64
_SAMPLES: Final = 9
"""Along a tile's side."""


@dataclass(frozen=True)
class HeightTint:
    """Heights from `low_m` to `high_m` have the colours from left to right of the image `key`."""

    low_m: float
    high_m: float
    key: str

    def uvs(self, heights_m: NDArray[np.float64]) -> NDArray[np.float32]:
        """Returns (n, 2) texture coordinates, between the centres of the first and the last texel."""
        part = np.clip((heights_m - self.low_m) / (self.high_m - self.low_m), 0.0, 1.0)
        u = (0.5 + part * (_SIZE_PX[0] - 1)) / _SIZE_PX[0]
        return np.stack([u, np.full_like(u, 0.5)], axis=-1).astype(np.float32)


def write_tint(folder: Path, grid: VertexGrid, field: HeightField, tiles: Iterator[GridTile]) -> HeightTint | None:
    """Writes the image into `folder`; returns None if there are no heights. `tiles`: those where there may be heights."""
    heights = _sample(grid, field, list(tiles))
    if not len(heights):
        return None
    low, high = (float(value) for value in np.quantile(heights, (BEYOND, 1.0 - BEYOND)))
    parts, colours = np.array([part for part, _ in COLOURS]), np.array([colour for _, colour in COLOURS])
    at = np.linspace(0.0, 1.0, _SIZE_PX[0])
    row = np.stack([np.interp(at, parts, colours[:, channel]) for channel in range(3)], axis=-1)
    image = Image.fromarray(np.broadcast_to(np.rint(row).astype(np.uint8), (_SIZE_PX[1], *row.shape)).copy())
    out = io.BytesIO()
    image.save(out, "PNG")
    key = sha256(out.getvalue()).hexdigest()[:32]
    (folder / f"{key}.png").write_bytes(out.getvalue())
    return HeightTint(low, max(high, low + LEAST_RANGE_M), key)


def _sample(grid: VertexGrid, field: HeightField, tiles: list[GridTile]) -> NDArray[np.float64]:
    """Returns heights spread over the terrain, without gaps."""
    found = []
    for number in np.unique(np.linspace(0, len(tiles) - 1, min(len(tiles), _SAMPLED_TILES)).astype(int)):
        rows, columns = (along[np.unique(np.linspace(0, len(along) - 1, _SAMPLES).astype(int))] for along in grid.positions(tiles[number]))
        found.append(field.heights(rows, columns).ravel())
    heights = np.concatenate(found) if found else np.empty(0)
    return heights[np.isfinite(heights)]
