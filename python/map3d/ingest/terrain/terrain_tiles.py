"""Builds the tiles of a terrain: the triangles of a part of the vertex grid, and their texture."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from map3d.ingest.terrain.grid_triangulation import Triangles, compact_vertices, orient_up, triangulate_all, triangulate_sparse
from map3d.ingest.terrain.height_tint import HeightTint
from map3d.ingest.terrain.orthophoto import TextureTile
from map3d.ingest.terrain.terrain_options import TerrainOptions
from map3d.ingest.terrain.terrain_rasters import TerrainRasters
from map3d.ingest.terrain.vertex_grid import GridTile, VertexGrid


@dataclass(frozen=True)
class TerrainTile:
    """`positions`: (n, 3) world; `triangles`: (t, 3); `uvs`: (n, 2) per vertex, None if there is no image. `texture`: None outside the photo."""

    row: int
    column: int
    positions: NDArray[np.float64]
    triangles: Triangles
    uvs: NDArray[np.float32] | None
    texture: TextureTile | None


@dataclass
class TileCounts:
    """`gaps`: grid points without a height; `implausible`: heights beyond the plausible; `untextured`: tiles outside the photo; `damaged`: paths of
    the rasters that cannot be read as a whole, sorted."""

    gaps: int = 0
    implausible: int = 0
    untextured: int = 0
    damaged: list[str] = field(default_factory=list)

    def add(self, other: "TileCounts") -> None:
        self.gaps += other.gaps
        self.implausible += other.implausible
        self.untextured += other.untextured
        self.damaged = sorted({*self.damaged, *other.damaged})


class TileBuilder:
    """Builds tiles from rasters that it alone reads."""

    def __init__(self, rasters: TerrainRasters, grid: VertexGrid, tint: HeightTint | None, options: TerrainOptions) -> None:
        """`tint`: colours of heights, without a photo."""
        self._rasters, self._grid, self._tint, self._options = rasters, grid, tint, options

    def close(self) -> None:
        self._rasters.close()

    def build(self, tile: GridTile, textures: Path, counts: TileCounts) -> TerrainTile | None:
        """Writes the texture into `textures` and adds to `counts`; returns None for a tile without triangles. Raises ImportFailed."""
        self._rasters.damage.names.clear()
        try:
            return self._build(tile, textures, counts)
        finally:
            counts.damaged = sorted({*counts.damaged, *self._rasters.damage.names})

    def _build(self, tile: GridTile, textures: Path, counts: TileCounts) -> TerrainTile | None:
        rasters = self._rasters
        rows, columns = self._grid.positions(tile)
        row_of, column_of = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        x, y = rasters.scene_from_base(*rasters.georeference.plane_from_pixels(row_of, column_of))
        heights = self._heights(rows, columns, counts)
        heights[~np.isfinite(x + y).reshape(heights.shape)] = np.nan
        counts.gaps += int(np.isnan(heights).sum())
        used, triangles = compact_vertices(self._triangulate(heights))
        if not len(triangles):
            return None
        positions = np.stack([x[used], y[used], heights.ravel()[used]], axis=-1)
        texture, photo_rows, photo_columns = self._cut_texture(textures, row_of[used], column_of[used])
        if texture is None and rasters.flat:
            return None
        counts.untextured += rasters.photo is not None and texture is None
        uvs = self._tint.uvs(positions[:, 2]) if self._tint else None if texture is None else texture.uvs(photo_columns, photo_rows)
        return TerrainTile(tile.row, tile.column, positions, orient_up(positions, triangles), uvs, texture)

    def _heights(self, rows: NDArray[np.float64], columns: NDArray[np.float64], counts: TileCounts) -> NDArray[np.float64]:
        field = self._rasters.height_field
        before = getattr(field, "implausible", 0)
        heights = field.heights(rows, columns)
        counts.implausible += getattr(field, "implausible", 0) - before
        return heights

    def _triangulate(self, heights: NDArray[np.float64]) -> Triangles:
        if self._options.max_error_m == 0:
            return triangulate_all(heights)
        side = self._grid.tile_cells + 1
        rows, columns = heights.shape
        padded = np.pad(heights, ((0, side - rows), (0, side - columns)), constant_values=np.nan)
        triangles = triangulate_sparse(padded, self._options.max_error_m)
        renumbered: Triangles = (triangles // side * columns + triangles % side).astype(np.uint32)
        return renumbered

    def _cut_texture(self, folder: Path, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> tuple[TextureTile | None, Any, Any]:
        """Returns the tile's texture, and the photo positions (rows, columns) of the vertices."""
        photo = self._rasters.photo
        if photo is None:
            return None, rows, columns
        rows, columns = self._rasters.photo_pixels(rows, columns)
        if not np.isfinite(rows + columns).all():
            return None, rows, columns
        box = (float(columns.min()), float(rows.min()), float(columns.max()), float(rows.max()))
        return photo.cut(box, folder, cutout=self._rasters.flat), rows, columns
