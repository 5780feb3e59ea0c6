"""Terrain from rasters: an elevation model and an orthophoto become an asset of textured ground tiles (spec/scene.md, Asset).

Ground without an elevation model is flat; ground without a photo has one colour. Rasters are read in windows and never held whole.
"""

import json
import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import rasterio
from numpy.typing import NDArray
from pyproj import CRS

from map3d.errors import BadRequest, LimitExceeded, Stopped
from map3d.ingest.crs import vertical_unit_m
from map3d.ingest.terrain.orthophoto import ALIGN_PX, MARGIN_PX, Orthophoto, TextureTile
from map3d.ingest.terrain.raster_georeference import Place, WayTo, crs_of, open_raster
from map3d.ingest.terrain.triangulation import Triangles, all_triangles, facing_up, few_triangles, used_vertices
from map3d.ingest.terrain.vertex_grid import FlatSurface, Grid, GridTile, RasterSurface, Surface, centre_positions, even_positions

Progress = Callable[[str, int, int], bool]
"""(stage, done, total) → False to stop."""

CLASS: Final = "terrain"
RANK: Final = 0
MAX_TRIANGLES: Final = 200_000_000
GDAL_CACHE_MB: Final = 64
FLAT_TILE_CELLS: Final = 8
METRES: Final = {"m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048}
US_FOOT_M: Final = 1200 / 3937
METRES_US: Final = {"us-ft": US_FOOT_M, "ftus": US_FOOT_M, "us survey foot": US_FOOT_M, "us survey feet": US_FOOT_M}


class AssetWriter(Protocol):
    """What of `map3d._core.AssetWriter` terrain needs."""

    def append_mesh(
        self, positions: NDArray[np.float64], triangles: NDArray[np.uint32], uvs: NDArray[np.float32] | None, material: int, object: int, rank: int
    ) -> None: ...
    def set_tables(self, materials: str, objects: str) -> None: ...
    def finish(self, reader: None) -> str: ...


@dataclass(frozen=True)
class TerrainOptions:
    """`max_error_m`: 0 keeps every height, else fewer triangles that differ by no more. `height_m`: of flat ground, without an elevation model.
    `height_unit_m`: metres of a unit of the elevation model; None: what the file says, else metres. `stretch`: photo values for black and white;
    None: from the data. `ground`: sRGB where there is no photo."""

    name: str = "terrain"
    max_error_m: float = 0.0
    tile_cells: int = 256
    texture_px: int = 2048
    height_m: float = 0.0
    height_unit_m: float | None = None
    ground: tuple[int, int, int] = (146, 146, 136)
    stretch: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.max_error_m) and self.max_error_m >= 0):
            raise BadRequest(f"greatest error {self.max_error_m} m: must be 0 or more")
        if not (1 <= self.tile_cells <= 2048 and self.tile_cells.bit_count() == 1):
            raise BadRequest(f"tile of {self.tile_cells} cells: must be a power of two up to 2048")
        if not 128 <= self.texture_px <= 16_384:
            raise BadRequest(f"texture of {self.texture_px} px: must be 128 to 16,384")
        if not np.isfinite(self.height_m):
            raise BadRequest(f"height {self.height_m} m: must be a number")


def import_terrain(
    dem: Path | None,
    ortho: Path | None,
    asset_folder: Path,
    scene_crs: CRS | None,
    options: TerrainOptions | None = None,
    progress: Progress | None = None,
    writer: AssetWriter | None = None,
) -> dict[str, Any]:
    """Writes the asset into `asset_folder` and returns its report. `scene_crs` None: a local scene, coordinates are taken as they are.

    Raises NotFound, ImportFailed, CrsError, LimitExceeded, BadRequest, Stopped.
    """
    options = options or TerrainOptions()
    if dem is None and ortho is None:
        raise BadRequest("terrain needs an elevation model, an orthophoto, or both")
    with rasterio.Env(GDAL_CACHEMAX=GDAL_CACHE_MB), ExitStack() as opened:
        dem_data = None if dem is None else opened.enter_context(open_raster(dem))
        ortho_data = None if ortho is None else opened.enter_context(open_raster(ortho))
        ground = _Ground(dem_data, ortho_data, scene_crs, options)
        (asset_folder / "textures").mkdir(parents=True, exist_ok=True)
        if writer is None:
            from map3d._core import AssetWriter as CoreWriter

            writer = CoreWriter(str(asset_folder))
        tally = ground.write(writer, asset_folder / "textures", progress or (lambda *_: True))
        report = ground.report(json.loads(writer.finish(None)), tally)
    _write_report(asset_folder / "report.json", report)
    return report


@dataclass
class _Tally:
    """What has been written, and what was left out."""

    materials: list[dict[str, Any]] = field(default_factory=list)
    objects: list[dict[str, Any]] = field(default_factory=list)
    triangles: int = 0
    gaps: int = 0
    untextured: int = 0
    plain: int | None = None
    """Number of the material without a texture."""


class _Ground:
    """The rasters, how they lie, and the grid over them."""

    def __init__(self, dem: Any, ortho: Any, scene_crs: CRS | None, options: TerrainOptions) -> None:
        self._options = options
        self._base = ortho if dem is None else dem
        self._flat = dem is None
        self._warnings: list[dict[str, Any]] = []
        crs = crs_of(self._base, scene_crs)
        self._place = Place(self._base, crs)
        self._scene_from_base = WayTo(crs, scene_crs)
        self._photo: Orthophoto | None = None
        if ortho is not None:
            self._photo = Orthophoto(ortho, options.ground, options.texture_px, options.stretch)
            photo_crs = crs_of(ortho, scene_crs)
            self._photo_place, self._photo_from_base = Place(ortho, photo_crs), WayTo(crs, photo_crs)
        self._surface: Surface = FlatSurface(options.height_m) if self._flat else RasterSurface(dem, self._unit_m(dem))
        self._grid = self._make_grid()
        self._note_missing_crs(dem, ortho, scene_crs)

    def write(self, writer: AssetWriter, textures: Path, progress: Progress) -> _Tally:
        tally = _Tally()
        for done, tile in enumerate(self._grid.tiles()):
            if not progress("terrain", done, self._grid.tile_count):
                raise Stopped(f"terrain stopped after {done} of {self._grid.tile_count} tiles; import again to start anew")
            self._write_tile(writer, textures, tile, tally)
        progress("terrain", self._grid.tile_count, self._grid.tile_count)
        writer.set_tables(json.dumps({"materials": tally.materials, "instances": []}), json.dumps(tally.objects))
        return tally

    def report(self, counts: dict[str, Any], tally: _Tally) -> dict[str, Any]:
        """The core's counts, with what only the rasters tell."""
        warnings = [*counts.get("warnings", []), *self._warnings]
        implausible = getattr(self._surface, "implausible", 0)
        for reason, count in (("heights beyond ±100 km taken for gaps", implausible), ("tiles that the photo does not reach", tally.untextured)):
            if count:
                warnings.append({"reason": reason, "count": count, "example": Path(self._base.name).name})
        return {
            **counts,
            "format": CLASS,
            "skipped": {**counts.get("skipped", {}), **({"no_height": tally.gaps} if tally.gaps else {})},
            "warnings": warnings,
            "crs": self._base.crs.to_wkt() if self._base.crs else None,
            "projection": {"operation": self._scene_from_base.description, "heights": "kept"},
        }

    def _write_tile(self, writer: AssetWriter, textures: Path, tile: GridTile, tally: _Tally) -> None:
        rows, columns = self._grid.positions(tile)
        row_of, column_of = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        x, y = self._scene_from_base(*self._place.plane_from_pixels(row_of, column_of))
        heights = self._surface.heights(rows, columns)
        heights[~np.isfinite(x + y).reshape(heights.shape)] = np.nan
        tally.gaps += int(np.isnan(heights).sum())
        used, triangles = used_vertices(self._triangulate(heights))
        if not len(triangles):
            return
        positions = np.stack([x[used], y[used], heights.ravel()[used]], axis=-1)
        texture, photo_rows, photo_columns = self._texture(textures, row_of[used], column_of[used])
        if texture is None and self._flat:
            return
        triangles = facing_up(positions, triangles)
        uvs = None if texture is None else texture.uvs(photo_columns, photo_rows)[triangles]
        self._count(tally, len(triangles), texture)
        material = self._material(tally, texture, tile)
        writer.append_mesh(positions, triangles, uvs, material, len(tally.objects), RANK)
        tally.objects.append({"name": self._name(tile), "class": CLASS, "parent": None, "lod": None, "attributes": {}})

    def _triangulate(self, heights: NDArray[np.float64]) -> Triangles:
        if self._options.max_error_m == 0:
            return all_triangles(heights)
        side = self._grid.tile_cells + 1
        rows, columns = heights.shape
        padded = np.pad(heights, ((0, side - rows), (0, side - columns)), constant_values=np.nan)
        triangles = few_triangles(padded, self._options.max_error_m)
        renumbered: Triangles = (triangles // side * columns + triangles % side).astype(np.uint32)
        return renumbered

    def _texture(self, folder: Path, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> tuple[TextureTile | None, Any, Any]:
        """The tile's texture, and the vertices' photo positions (rows, columns)."""
        if self._photo is None:
            return None, rows, columns
        if not self._flat:
            rows, columns = self._photo_place.pixels_from_plane(*self._photo_from_base(*self._place.plane_from_pixels(rows, columns)))
            if not np.isfinite(rows + columns).all():
                return None, rows, columns
        box = (float(columns.min()), float(rows.min()), float(columns.max()), float(rows.max()))
        return self._photo.cut(box, folder, cutout=self._flat), rows, columns

    def _count(self, tally: _Tally, triangles: int, texture: TextureTile | None) -> None:
        tally.triangles += triangles
        if tally.triangles > MAX_TRIANGLES:
            raise LimitExceeded(f"terrain of more than {MAX_TRIANGLES:,} triangles, the most an asset may have; give a greater error (--max-error)")
        tally.untextured += self._photo is not None and texture is None

    def _material(self, tally: _Tally, texture: TextureTile | None, tile: GridTile) -> int:
        if texture is None and tally.plain is not None:
            return tally.plain
        row: dict[str, Any] = {"name": self._name(tile) if texture else "ground", "diffuse": [1.0, 1.0, 1.0, 1.0], "texture": None, "alpha": None}
        row |= {"wrap": "clamp", "border": [0.0, 0.0, 0.0, 0.0], "cutout": False}
        if texture is None:
            row["diffuse"] = [*(value / 255 for value in self._options.ground), 1.0]
            tally.plain = len(tally.materials)
        else:
            row |= {"texture": texture.key, "cutout": texture.cutout}
        tally.materials.append(row)
        return len(tally.materials) - 1

    def _name(self, tile: GridTile) -> str:
        return f"{self._options.name}-{tile.row}-{tile.column}"

    def _make_grid(self) -> Grid:
        """Tiles whose texture fits one image at the photo's own resolution."""
        room = self._options.texture_px - 2 * (MARGIN_PX + ALIGN_PX)
        height, width = self._base.height, self._base.width
        if self._flat:
            step = room / FLAT_TILE_CELLS
            return Grid(even_positions(height, step), even_positions(width, step), FLAT_TILE_CELLS)
        cell_px = self._cell_px()
        parts = max(1, -(-int(np.ceil(cell_px)) // room))
        cells = self._options.tile_cells
        while cells > 1 and cells * cell_px / parts > room:
            cells //= 2
        grid = Grid(centre_positions(height, parts), centre_positions(width, parts), cells)
        if self._options.max_error_m == 0 and 2 * grid.cell_count > MAX_TRIANGLES:
            raise LimitExceeded(
                f"{self._base.name}: {2 * grid.cell_count:,} triangles, an asset may have {MAX_TRIANGLES:,}; allow a greatest error (--max-error)"
            )
        return grid

    def _cell_px(self) -> float:
        """Photo pixels that a cell of the elevation model is wide or high, the most of five places; 0 without a photo."""
        if self._photo is None:
            return 0.0
        height, width = self._base.height, self._base.width
        row, column = np.array([0.0, 0.0, height - 1.0, height - 1.0, height / 2]), np.array([0.0, width - 1.0, 0.0, width - 1.0, width / 2])
        corners = [self._photo_from_base(*self._place.plane_from_pixels(row + dr, column + dc)) for dr in (0.0, 1.0) for dc in (0.0, 1.0)]
        pixels = np.array([self._photo_place.pixels_from_plane(*corner) for corner in corners])
        extent = pixels.max(axis=0) - pixels.min(axis=0)
        finite = extent[np.isfinite(extent)]
        return float(finite.max()) if len(finite) else 0.0

    def _unit_m(self, dem: Any) -> float:
        if self._options.height_unit_m is not None:
            return self._options.height_unit_m
        unit = (dem.units[0] or "").strip().lower()
        if not unit:
            return vertical_unit_m(CRS.from_user_input(dem.crs)) if dem.crs else 1.0
        if unit in METRES:
            return METRES[unit]
        if unit in METRES_US:
            return METRES_US[unit]
        self._warnings.append({"reason": "unknown unit of height, taken for metres", "count": 1, "example": unit})
        return 1.0

    def _note_missing_crs(self, dem: Any, ortho: Any, scene_crs: CRS | None) -> None:
        for dataset in (dem, ortho):
            if dataset is not None and dataset.crs is None and scene_crs is not None:
                self._warnings.append({"reason": "raster without CRS, taken for the scene's", "count": 1, "example": Path(dataset.name).name})


def _write_report(path: Path, report: dict[str, Any]) -> None:
    draft = path.with_suffix(".tmp")
    draft.write_text(json.dumps(report, ensure_ascii=False, indent=1) + "\n")
    os.replace(draft, path)
