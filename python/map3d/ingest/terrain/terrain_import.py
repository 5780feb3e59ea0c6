"""Imports an elevation model and an orthophoto as an asset of textured terrain tiles (spec/scene.md, Asset).

Without an elevation model the terrain is flat, without a photo it has the colours of its heights. Rasters are read in windows, never as a whole.
"""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import rasterio
from numpy.typing import NDArray
from pyproj import CRS

from map3d.errors import BadRequest, LimitExceeded, Stopped
from map3d.geometry.crs import vertical_unit_m
from map3d.ingest.terrain.grid_triangulation import Triangles, compact_vertices, orient_up, triangulate_all, triangulate_sparse
from map3d.ingest.terrain.height_tint import HeightTint, write_tint
from map3d.ingest.terrain.orthophoto import ALIGN_PX, MARGIN_PX, Orthophoto, TextureTile
from map3d.ingest.terrain.raster_georeference import PlaneTransformer, RasterGeoreference, open_raster, own_crs, raster_crs
from map3d.ingest.terrain.raster_mosaic import MosaicHeightField, MosaicPhoto, RasterMosaic
from map3d.ingest.terrain.vertex_grid import (
    ConstantHeightField,
    GridTile,
    HeightField,
    RasterHeightField,
    VertexGrid,
    pixel_centre_positions,
    regular_positions,
)

OnTile = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop."""

CLASS: Final = "terrain"
RANK: Final = 0
MAX_TRIANGLES: Final = 200_000_000
MAX_TILES: Final = 10_000_000
REDUCE_RASTER: Final = "allow a height error, such as --max-error 0.1, or reduce the resolution with gdal_translate -tr"
GDAL_CACHE_MB: Final = 64
FLAT_TILE_CELLS: Final = 8
UNITS_M: Final = {"m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048}
US_FOOT_M: Final = 1200 / 3937
US_UNITS_M: Final = {"us-ft": US_FOOT_M, "ftus": US_FOOT_M, "us survey foot": US_FOOT_M, "us survey feet": US_FOOT_M}


class MeshWriter(Protocol):
    """The methods of `map3d._core.AssetWriter` that the terrain import calls."""

    def append_mesh(
        self, positions: NDArray[np.float64], triangles: NDArray[np.uint32], uvs: NDArray[np.float32] | None, material: int, object: int, rank: int
    ) -> None: ...
    def set_tables(self, materials: str, objects: str) -> None: ...
    def finish(self, reader: None) -> str: ...


@dataclass(frozen=True)
class TerrainOptions:
    """`max_error_m`: greatest height error of the triangles, 0 keeps every height. `height_m`: height of flat terrain without an elevation model.
    `height_unit_m`: metres per unit of the elevation model; None takes the unit from the file, else metres. `stretch`: photo values for black and
    white; None derives them from the data. `ground`: sRGB colour in gaps of the photo. `crs`: overrides the CRS of both rasters, or supplies a
    missing one; "local" for plain metres."""

    name: str = "terrain"
    max_error_m: float = 0.0
    tile_cells: int = 256
    texture_px: int = 2048
    height_m: float = 0.0
    height_unit_m: float | None = None
    ground: tuple[int, int, int] = (146, 146, 136)
    stretch: tuple[float, float] | None = None
    crs: str | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.max_error_m) and self.max_error_m >= 0):
            raise BadRequest(f"greatest height error {self.max_error_m} m is out of range; give 0 or more")
        if not (1 <= self.tile_cells <= 2048 and self.tile_cells.bit_count() == 1):
            raise BadRequest(f"{self.tile_cells} cells per tile side is out of range; give a power of two from 1 to 2,048")
        if not 128 <= self.texture_px <= 16_384:
            raise BadRequest(f"texture size {self.texture_px} px is out of range; give 128 to 16,384")
        if not np.isfinite(self.height_m):
            raise BadRequest(f"terrain height {self.height_m} m is not finite; give a number")


def import_terrain(
    dem: Path | Sequence[Path] | None,
    ortho: Path | Sequence[Path] | None,
    asset_folder: Path,
    scene_crs: CRS | None,
    options: TerrainOptions | None = None,
    progress: OnTile | None = None,
    writer: MeshWriter | None = None,
) -> dict[str, Any]:
    """Writes the asset into `asset_folder` and returns its report. Several rasters of one kind are a mosaic.

    With `scene_crs` None the scene is local and coordinates stay unchanged.

    Raises NotFound, ImportFailed, CrsError, LimitExceeded, BadRequest, Stopped.
    """
    options = options or TerrainOptions()
    dems, orthos = _paths(dem), _paths(ortho)
    if not dems and not orthos:
        raise BadRequest("nothing to import; give an elevation model, an orthophoto, or both")
    with rasterio.Env(GDAL_CACHEMAX=GDAL_CACHE_MB), ExitStack() as opened:
        dem_data = opened.enter_context(_open(dems, options, MAX_TRIANGLES / 2 if options.max_error_m == 0 else None)) if dems else None
        ortho_data = opened.enter_context(_open(orthos, options)) if orthos else None
        builder = _TerrainBuilder(dem_data, ortho_data, scene_crs, options)
        (asset_folder / "textures").mkdir(parents=True, exist_ok=True)
        if writer is None:
            from map3d._core import AssetWriter

            writer = AssetWriter(str(asset_folder))
        content = builder.write(writer, asset_folder / "textures", progress or (lambda *_: True))
        report = builder.report(json.loads(writer.finish(None)), content)
    _write_report(asset_folder / "report.json", report)
    return report


def _paths(rasters: Path | Sequence[Path] | None) -> Sequence[Path]:
    return [] if rasters is None else [rasters] if isinstance(rasters, Path) else rasters


def _open(paths: Sequence[Path], options: TerrainOptions, max_pixels: float | None = None) -> Any:
    """Opens a raster, or a mosaic of several with at most `max_pixels`: if the finest pixels are too many, those of the next raster count."""
    if len(paths) == 1:
        return open_raster(paths[0])
    mosaic = RasterMosaic(paths, options.crs)
    for pixel in mosaic.pixels[1:]:
        if max_pixels is None or mosaic.covered_pixels <= max_pixels:
            break
        mosaic = RasterMosaic(paths, options.crs, pixel)
    return mosaic


@dataclass
class _TerrainContent:
    """Materials and objects of the asset, and counts for its report."""

    materials: list[dict[str, Any]] = field(default_factory=list)
    objects: list[dict[str, Any]] = field(default_factory=list)
    triangles: int = 0
    gaps: int = 0
    untextured_tiles: int = 0
    shared_material: int | None = None
    """Index of the material of all tiles outside the photo, or of all without a photo."""
    tint: HeightTint | None = None
    """Colours of heights, without a photo."""


class _TerrainBuilder:
    """Samples the rasters on a vertex grid and writes its tiles."""

    def __init__(self, dem: Any, ortho: Any, scene_crs: CRS | None, options: TerrainOptions) -> None:
        self._options = options
        self._base = ortho if dem is None else dem
        self._flat = dem is None
        self._warnings: list[dict[str, Any]] = [warning for raster in (dem, ortho) for warning in _mosaic_warnings(raster)]
        crs = raster_crs(self._base, scene_crs, options.crs)
        self._georeference = RasterGeoreference(self._base, crs)
        self._scene_from_base = PlaneTransformer(crs, scene_crs)
        self._photo: Orthophoto | None = None
        if ortho is not None:
            photo_type = MosaicPhoto if isinstance(ortho, RasterMosaic) else Orthophoto
            self._photo = photo_type(ortho, options.ground, options.texture_px, options.stretch)
            photo_crs = raster_crs(ortho, scene_crs, options.crs)
            self._photo_georeference = RasterGeoreference(ortho, photo_crs)
            self._photo_from_base = PlaneTransformer(crs, photo_crs)
        self._height_field = self._open_heights(dem)
        self._grid = self._create_grid()
        self._warn_about_missing_crs(dem, ortho, scene_crs)

    def _open_heights(self, dem: Any) -> HeightField:
        if dem is None:
            return ConstantHeightField(self._options.height_m)
        if isinstance(dem, RasterMosaic):
            return MosaicHeightField(dem, self._height_unit_m)
        return RasterHeightField(dem, self._height_unit_m(dem))

    def write(self, writer: MeshWriter, textures: Path, progress: OnTile) -> _TerrainContent:
        content = _TerrainContent()
        if self._photo is None:
            content.tint = write_tint(textures, self._grid, self._height_field, filter(self._is_covered, self._grid.tiles()))
        for done, tile in enumerate(self._grid.tiles()):
            if not progress("terrain", done, self._grid.tile_count):
                raise Stopped(f"terrain import stopped after {done} of {self._grid.tile_count} tiles; import the file again to start over")
            if self._is_covered(tile):
                self._write_tile(writer, textures, tile, content)
        progress("terrain", self._grid.tile_count, self._grid.tile_count)
        writer.set_tables(json.dumps({"materials": content.materials, "instances": []}), json.dumps(content.objects))
        return content

    def report(self, counts: dict[str, Any], content: _TerrainContent) -> dict[str, Any]:
        """Adds counts and warnings about the rasters to the counts of the core."""
        warnings = [*counts.get("warnings", []), *self._warnings]
        implausible = getattr(self._height_field, "implausible", 0)
        for reason, count in (("heights beyond ±100 km count as gaps", implausible), ("tiles outside the photo", content.untextured_tiles)):
            if count:
                warnings.append({"reason": reason, "count": count, "example": Path(self._base.name).name})
        return {
            **counts,
            "format": CLASS,
            "skipped": {**counts.get("skipped", {}), **({"grid points without a height": content.gaps} if content.gaps else {})},
            "warnings": warnings,
            "crs": self._crs_wkt(),
            "projection": {"operation": self._scene_from_base.description, "heights": "unchanged"},
        }

    def _is_covered(self, tile: GridTile) -> bool:
        """Whether a raster of the mosaic reaches a tile; always true of a single raster."""
        rows, columns = self._grid.positions(tile)
        return not isinstance(self._base, RasterMosaic) or self._base.covers(columns[0], rows[0], columns[-1], rows[-1])

    def _write_tile(self, writer: MeshWriter, textures: Path, tile: GridTile, content: _TerrainContent) -> None:
        rows, columns = self._grid.positions(tile)
        row_of, column_of = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        x, y = self._scene_from_base(*self._georeference.plane_from_pixels(row_of, column_of))
        heights = self._height_field.heights(rows, columns)
        heights[~np.isfinite(x + y).reshape(heights.shape)] = np.nan
        content.gaps += int(np.isnan(heights).sum())
        used, triangles = compact_vertices(self._triangulate(heights))
        if not len(triangles):
            return
        positions = np.stack([x[used], y[used], heights.ravel()[used]], axis=-1)
        texture, photo_rows, photo_columns = self._cut_texture(textures, row_of[used], column_of[used])
        if texture is None and self._flat:
            return
        triangles = orient_up(positions, triangles)
        corners = content.tint.uvs(positions[:, 2]) if content.tint else None if texture is None else texture.uvs(photo_columns, photo_rows)
        uvs = None if corners is None else corners[triangles]
        self._update_counts(content, len(triangles), texture)
        material = self._add_material(content, texture, tile)
        writer.append_mesh(positions, triangles, uvs, material, len(content.objects), RANK)
        content.objects.append({"name": self._tile_name(tile), "class": CLASS, "parent": None, "lod": None, "attributes": {}})

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
        if self._photo is None:
            return None, rows, columns
        if not self._flat:
            rows, columns = self._photo_georeference.pixels_from_plane(*self._photo_from_base(*self._georeference.plane_from_pixels(rows, columns)))
            if not np.isfinite(rows + columns).all():
                return None, rows, columns
        box = (float(columns.min()), float(rows.min()), float(columns.max()), float(rows.max()))
        return self._photo.cut(box, folder, cutout=self._flat), rows, columns

    def _update_counts(self, content: _TerrainContent, triangles: int, texture: TextureTile | None) -> None:
        content.triangles += triangles
        if content.triangles > MAX_TRIANGLES:
            raise LimitExceeded(f"{self._base.name}: more than {MAX_TRIANGLES:,} triangles, the limit of an asset; {REDUCE_RASTER}")
        content.untextured_tiles += self._photo is not None and texture is None

    def _add_material(self, content: _TerrainContent, texture: TextureTile | None, tile: GridTile) -> int:
        if texture is None and content.shared_material is not None:
            return content.shared_material
        row: dict[str, Any] = {
            "name": self._tile_name(tile) if texture else "ground",
            "diffuse": [1.0, 1.0, 1.0, 1.0],
            "texture": None,
            "alpha": None,
        }
        row |= {"wrap": "clamp", "border": [0.0, 0.0, 0.0, 0.0], "cutout": False}
        if texture is None:
            content.shared_material = len(content.materials)
            if content.tint is None:
                row["diffuse"] = [*(value / 255 for value in self._options.ground), 1.0]
            else:
                row["texture"] = content.tint.key
        else:
            row |= {"texture": texture.key, "cutout": texture.cutout}
        content.materials.append(row)
        return len(content.materials) - 1

    def _tile_name(self, tile: GridTile) -> str:
        return f"{self._options.name}-{tile.row}-{tile.column}"

    def _create_grid(self) -> VertexGrid:
        """Chooses tiles small enough that each texture fits one image at the photo's full resolution."""
        free_px = self._options.texture_px - 2 * (MARGIN_PX + ALIGN_PX)
        height, width = self._base.height, self._base.width
        if self._flat:
            step = free_px / FLAT_TILE_CELLS
            return VertexGrid(regular_positions(height, step), regular_positions(width, step), FLAT_TILE_CELLS)
        cell_px = self._photo_px_per_cell()
        parts = max(1, -(-int(np.ceil(cell_px)) // free_px))
        side = self._options.tile_cells
        while side > 1 and side * cell_px / parts > free_px:
            side //= 2
        grid = VertexGrid(pixel_centre_positions(height, parts), pixel_centre_positions(width, parts), side)
        if grid.tile_count > MAX_TILES:
            raise LimitExceeded(f"{self._base.name}: the rasters lie too far apart for one terrain; import them one by one")
        cells = self._base.covered_pixels * parts**2 if isinstance(self._base, RasterMosaic) else grid.cell_count
        if self._options.max_error_m == 0 and 2 * cells > MAX_TRIANGLES:
            raise LimitExceeded(f"{self._base.name}: {2 * cells:,} triangles, the limit of an asset is {MAX_TRIANGLES:,}; {REDUCE_RASTER}")
        return grid

    def _photo_px_per_cell(self) -> float:
        """Returns the width or height of an elevation cell in photo pixels, the maximum over five cells; 0 without a photo."""
        if self._photo is None:
            return 0.0
        height, width = self._base.height, self._base.width
        row, column = np.array([0.0, 0.0, height - 1.0, height - 1.0, height / 2]), np.array([0.0, width - 1.0, 0.0, width - 1.0, width / 2])
        corners = [self._photo_from_base(*self._georeference.plane_from_pixels(row + dr, column + dc)) for dr in (0.0, 1.0) for dc in (0.0, 1.0)]
        pixels = np.array([self._photo_georeference.pixels_from_plane(*corner) for corner in corners])
        extent = pixels.max(axis=0) - pixels.min(axis=0)
        finite = extent[np.isfinite(extent)]
        return float(finite.max()) if len(finite) else 0.0

    def _height_unit_m(self, dem: Any) -> float:
        if self._options.height_unit_m is not None:
            return self._options.height_unit_m
        unit = (dem.units[0] or "").strip().lower()
        if not unit:
            crs = own_crs(dem, self._options.crs)
            return 1.0 if crs is None else vertical_unit_m(crs)
        if unit in UNITS_M:
            return UNITS_M[unit]
        if unit in US_UNITS_M:
            return US_UNITS_M[unit]
        self._warnings.append({"reason": "unknown height unit, assumed metres", "count": 1, "example": unit})
        return 1.0

    def _crs_wkt(self) -> str | None:
        if self._options.crs is None:
            return self._base.crs.to_wkt() if self._base.crs else None
        stated = own_crs(self._base, self._options.crs)
        return None if stated is None else stated.to_wkt()

    def _warn_about_missing_crs(self, dem: Any, ortho: Any, scene_crs: CRS | None) -> None:
        if scene_crs is None or self._options.crs is not None:
            return
        for dataset in (dem, ortho):
            if dataset is not None and dataset.crs is None:
                self._warnings.append({"reason": "raster without CRS, assumed the scene's", "count": 1, "example": Path(dataset.name).name})


def _mosaic_warnings(raster: Any) -> list[dict[str, Any]]:
    """Says at which resolution rasters of different ones are read."""
    if not isinstance(raster, RasterMosaic) or len(raster.pixels) == 1:
        return []
    pixels = ", ".join(f"{pixel:.6g}" for pixel in raster.pixels)
    example = f"{Path(raster.name).name}: pixels of {pixels}; all are read with pixels of {raster.pixel:.6g}"
    return [{"reason": "rasters of different resolution", "count": 1, "example": example, "scope": "file"}]


def _write_report(path: Path, report: dict[str, Any]) -> None:
    draft = path.with_suffix(".tmp")
    draft.write_text(json.dumps(report, ensure_ascii=False, indent=1) + "\n")
    os.replace(draft, path)
