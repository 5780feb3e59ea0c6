"""The opened rasters of a terrain: heights, photo, and the transformations between their planes and the scene's."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS

from map3d.errors import LimitExceeded
from map3d.geometry.crs import horizontal_crs, vertical_unit_m
from map3d.ingest.exactness import transformation_findings
from map3d.ingest.findings import finding
from map3d.ingest.terrain.damaged_reads import Damage
from map3d.ingest.terrain.ground_heights import GroundHeightField
from map3d.ingest.terrain.height_voids import HeightVoids
from map3d.ingest.terrain.orthophoto import ALIGN_PX, MARGIN_PX, Orthophoto
from map3d.ingest.terrain.photo_margin import PhotoMargin, PhotoMargins
from map3d.ingest.terrain.photo_values import ValueRange
from map3d.ingest.terrain.raster_choice import UNDER, covered_share
from map3d.ingest.terrain.raster_georeference import PlaneTransformer, RasterGeoreference, open_raster, own_crs, place_of, raster_crs
from map3d.ingest.terrain.raster_mosaic import MosaicHeightField, MosaicPhoto, RasterMosaic
from map3d.ingest.terrain.terrain_options import TerrainOptions
from map3d.ingest.terrain.vertex_grid import (
    ConstantHeightField,
    GridTile,
    HeightField,
    RasterHeightField,
    VertexGrid,
    pixel_centre_positions,
    regular_positions,
)

MAX_TRIANGLES: Final = 200_000_000
MAX_TILES: Final = 10_000_000
REDUCE_RASTER: Final = "allow a height error, such as --max-error 0.1, or reduce the resolution with gdal_translate -tr"
FLAT_TILE_CELLS: Final = 8
MAX_DRAPED_TILE_CELLS: Final = 64
UNITS_M: Final = {"m": 1.0, "metre": 1.0, "meter": 1.0, "metres": 1.0, "meters": 1.0, "ft": 0.3048, "foot": 0.3048, "feet": 0.3048}
US_FOOT_M: Final = 1200 / 3937
US_UNITS_M: Final = {"us-ft": US_FOOT_M, "ftus": US_FOOT_M, "us survey foot": US_FOOT_M, "us survey feet": US_FOOT_M}


class TerrainRasters:
    """The rasters of a terrain. Context manager; for one thread at a time, see `reopen`."""

    def __init__(self, dems: Sequence[Path], orthos: Sequence[Path], scene_crs: CRS | None, options: TerrainOptions) -> None:
        """Raises NotFound, ImportFailed, CrsError, LimitExceeded."""
        self._opened = ExitStack()
        try:
            dem = _open(dems, options, MAX_TRIANGLES / 2 if options.max_error_m == 0 else None) if dems else None
            self._margins, self._voids = PhotoMargins(), HeightVoids()
            self._open_all(dem, _open(orthos, options) if orthos else None, scene_crs, options, None)
        except BaseException:
            self._opened.close()
            raise

    def reopen(self) -> Self:
        """Returns the same rasters for another thread."""
        other = object.__new__(type(self))
        other._opened, other._margins, other._voids = ExitStack(), self._margins, self._voids
        value_range = None if self.photo is None else self.photo.value_range
        dem, ortho = (None if raster is None else _reopen(raster) for raster in (self.dem, self.ortho))
        other._open_all(dem, ortho, self._scene_crs, self._options, value_range)
        return other

    def _open_all(self, dem: Any, ortho: Any, scene_crs: CRS | None, options: TerrainOptions, value_range: ValueRange | None) -> None:
        for raster in (dem, ortho):
            if raster is not None:
                self._opened.enter_context(raster)
        self.dem, self.ortho, self._scene_crs, self._options = dem, ortho, scene_crs, options
        self.damage = Damage(strict=options.strict)
        self.base = ortho if dem is None else dem
        self.flat = dem is None
        crs = raster_crs(self.base, scene_crs, options.crs)
        self.georeference = RasterGeoreference(self.base, crs)
        place = place_of(self.base, crs)
        self.scene_from_base = PlaneTransformer(crs, scene_crs, place)
        self.photo: Orthophoto | None = None
        if ortho is not None:
            self.photo = self._open_photo(ortho, value_range)
            photo_crs = raster_crs(ortho, scene_crs, options.crs)
            self.photo_georeference = RasterGeoreference(ortho, photo_crs)
            self.photo_from_base = PlaneTransformer(crs, photo_crs, place)
        self.height_field = self._open_heights(dem)

    def _open_photo(self, ortho: Any, value_range: ValueRange | None) -> Orthophoto:
        ground, side = self._options.ground, self._options.texture_px
        if isinstance(ortho, RasterMosaic):
            return MosaicPhoto(ortho, ground, side, value_range, self._margins, self.damage)
        return Orthophoto(ortho, ground, side, value_range, self._margins.of(Path(ortho.name), ortho, ortho), self.damage)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._opened.close()

    @property
    def crs_wkt(self) -> str | None:
        if self._options.crs is None:
            return self.base.crs.to_wkt() if self.base.crs else None
        stated = own_crs(self.base, self._options.crs)
        return None if stated is None else stated.to_wkt()

    def covered_tiles(self, grid: VertexGrid) -> Iterator[GridTile]:
        """Yields the tiles that a raster of the mosaic reaches; of a single raster, all."""
        for tile in grid.tiles():
            rows, columns = grid.positions(tile)
            if not isinstance(self.base, RasterMosaic) or self.base.covers(columns[0], rows[0], columns[-1], rows[-1]):
                yield tile

    def create_grid(self) -> VertexGrid:
        """Chooses tiles small enough that each texture fits one image at the photo's full resolution. Raises LimitExceeded."""
        free_px = self._options.texture_px - 2 * (MARGIN_PX + ALIGN_PX)
        height, width = self.base.height, self.base.width
        if self.flat:
            cells = FLAT_TILE_CELLS
            if isinstance(self.height_field, GroundHeightField):
                cells = max(cells, min(MAX_DRAPED_TILE_CELLS, int(np.ceil(self.height_field.cells_of(free_px)))))
            step = free_px / cells
            return self._checked(VertexGrid(regular_positions(height, step), regular_positions(width, step), cells), 1)
        cell_px = self._photo_px_per_cell()
        parts = max(1, -(-int(np.ceil(cell_px)) // free_px))
        side = self._options.tile_cells
        while side > 1 and side * cell_px / parts > free_px:
            side //= 2
        return self._checked(VertexGrid(pixel_centre_positions(height, parts), pixel_centre_positions(width, parts), side), parts)

    def findings(self) -> list[dict[str, Any]]:
        """Returns what is odd about the rasters, before any tile is built."""
        found = [item for raster in (self.dem, self.ortho) for item in _mosaic_findings(raster)]
        found += self._photo_findings()
        unknown = [unit for unit in map(self._unknown_unit, _datasets(self.dem)) if unit]
        if unknown:
            found.append(finding("height-unit-unknown", len(unknown), unknown[0]))
        voids = [(Path(name).name, value) for name, value in self._void_values() if value is not None]
        if voids:
            found.append(finding("heights-void-value", len(voids), f"{voids[0][0]}: {voids[0][1]:g}"))
        if isinstance(self.height_field, GroundHeightField):
            found.append(finding("photo-draped-on-bases", len(list(_datasets(self.ortho))), Path(self.base.name).name))
        if self._scene_crs is not None and self._options.crs is None:
            missing = [raster for raster in (self.dem, self.ortho) if raster is not None and raster.crs is None]
            found += [finding("raster-crs-assumed", 1, Path(raster.name).name) for raster in missing]
        return found

    def _void_values(self) -> Iterator[tuple[str, float | None]]:
        """Yields each elevation model with the value that means no height, though it does not declare it."""
        if isinstance(self.dem, RasterMosaic):
            for part in self.dem.parts:
                yield str(part.path), self.dem.voids.of(part.path, self.dem.source(part))
        elif self.dem is not None:
            yield str(self.dem.name), self._voids.of(Path(self.dem.name), self.dem)

    def exactness(self) -> list[dict[str, Any]]:
        """Returns how exactly the rasters are transformed, as findings of a report."""
        to_photo = [] if self.photo is None else [(self.photo_from_base, self.photo_georeference.crs)]
        found = []
        for plane, target in [(self.scene_from_base, self._scene_crs), *to_photo]:
            if plane.transformation is not None and target is not None and self.georeference.crs is not None:
                names = {"from": str(self.georeference.crs.name), "to": str(horizontal_crs(target).name)}
                found += transformation_findings(plane.transformation, names)
        return found

    def _photo_findings(self) -> list[dict[str, Any]]:
        """Says which photos have other values than bytes, and which have a margin that is transparent."""
        if self.photo is None:
            return []
        found = []
        scaled = [Path(raster.name).name for raster in _datasets(self.ortho) if raster.dtypes[0] != "uint8"]
        if scaled and self.photo.value_range.words:
            found.append(finding("photo-values-scaled", len(scaled), f"{scaled[0]}: {self.photo.value_range}"))
        margins = [(Path(name).name, margin.name) for name, margin in self._photo_margins() if margin is not None]
        if margins:
            found.append(finding("photo-margin-transparent", len(margins), f"{margins[0][0]}: {margins[0][1]}"))
        return found

    def _photo_margins(self) -> Iterator[tuple[str, PhotoMargin | None]]:
        if isinstance(self.ortho, RasterMosaic):
            for part in self.ortho.parts:
                yield str(part.path), self._margins.of(part.path, self.ortho.open(part), self.ortho.source(part))
        else:
            yield str(self.ortho.name), self._margins.of(Path(self.ortho.name), self.ortho, self.ortho)

    def _checked(self, grid: VertexGrid, parts: int) -> VertexGrid:
        name = self.base.name
        if grid.tile_count > MAX_TILES and isinstance(self.base, RasterMosaic):
            raise LimitExceeded(f"{name}: the rasters lie too far apart for one terrain; import them one by one")
        if grid.tile_count > MAX_TILES:
            limit = f"the limit is {MAX_TILES:,}; reduce the resolution with gdal_translate -tr, or split the raster"
            raise LimitExceeded(f"{name}: {grid.tile_count:,} tiles of terrain, {limit}")
        cells = self.base.covered_pixels * parts**2 if isinstance(self.base, RasterMosaic) else grid.cell_count
        if not self.flat and self._options.max_error_m == 0 and 2 * cells > MAX_TRIANGLES:
            raise LimitExceeded(f"{name}: {2 * cells:,} triangles, the limit of an asset is {MAX_TRIANGLES:,}; {REDUCE_RASTER}")
        return grid

    def _photo_px_per_cell(self) -> float:
        """Returns the width or height of an elevation cell in photo pixels, the maximum over five cells; 0 without a photo."""
        if self.photo is None:
            return 0.0
        height, width = self.base.height, self.base.width
        row, column = np.array([0.0, 0.0, height - 1.0, height - 1.0, height / 2]), np.array([0.0, width - 1.0, 0.0, width - 1.0, width / 2])
        pixels = np.array([self.photo_pixels(row + dr, column + dc) for dr in (0.0, 1.0) for dc in (0.0, 1.0)])
        extent = pixels.max(axis=0) - pixels.min(axis=0)
        finite = extent[np.isfinite(extent)]
        return float(finite.max()) if len(finite) else 0.0

    def photo_pixels(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Returns the (rows, columns) in the photo of positions in the base raster; infinite where no transformation reaches."""
        if self.flat:
            return rows, columns
        return self.photo_georeference.pixels_from_plane(*self.photo_from_base(*self.georeference.plane_from_pixels(rows, columns)))

    def _open_heights(self, dem: Any) -> HeightField:
        if dem is None and self._options.ground_grid is not None:
            return GroundHeightField(self, self._options.ground_grid)
        if dem is None:
            return ConstantHeightField(self._options.height_m)
        if isinstance(dem, RasterMosaic):
            return MosaicHeightField(dem, self._height_unit_m, self.damage)
        return RasterHeightField(dem, self._height_unit_m(dem), damage=self.damage, void=self._voids.of(Path(dem.name), dem))

    def _height_unit_m(self, dem: Any) -> float:
        if self._options.height_unit_m is not None:
            return self._options.height_unit_m
        unit = _unit(dem)
        if not unit:
            crs = own_crs(dem, self._options.crs)
            return 1.0 if crs is None else vertical_unit_m(crs)
        return UNITS_M.get(unit) or US_UNITS_M.get(unit) or 1.0

    def _unknown_unit(self, dem: Any) -> str | None:
        unit = _unit(dem)
        return unit if self._options.height_unit_m is None and unit and unit not in UNITS_M and unit not in US_UNITS_M else None


def _open(paths: Sequence[Path], options: TerrainOptions, max_pixels: float | None = None) -> Any:
    """Opens a raster, or a mosaic of several with at most `max_pixels`: if the finest pixels are too many, those of the next raster count."""
    if len(paths) == 1:
        return open_raster(paths[0])
    mosaic = RasterMosaic(paths, options.crs, ranks=options.ranks)
    for pixel in mosaic.pixels[1:]:
        if max_pixels is None or mosaic.covered_pixels <= max_pixels:
            break
        mosaic = RasterMosaic(paths, options.crs, pixel, options.ranks)
    return mosaic


def _reopen(raster: Any) -> Any:
    return raster.reopen() if isinstance(raster, RasterMosaic) else open_raster(Path(raster.name))


def _datasets(raster: Any) -> Iterable[Any]:
    """Returns the dataset of a raster, or the datasets of a mosaic."""
    if raster is None:
        return []
    return (raster.source(part) for part in raster.parts) if isinstance(raster, RasterMosaic) else [raster]


def _unit(dem: Any) -> str:
    return (dem.units[0] or "").strip().lower()


def _mosaic_findings(raster: Any) -> list[dict[str, Any]]:
    """Says at which resolution rasters of different ones are read, and which lie under others."""
    if not isinstance(raster, RasterMosaic):
        return []
    found = []
    if len(raster.pixels) > 1:
        pixels = ", ".join(f"{pixel:.6g}" for pixel in raster.pixels)
        example = f"{Path(raster.name).name}: pixels of {pixels}; all are read with pixels of {raster.pixel:.6g}"
        found.append(finding("raster-resolutions-differ", 1, example))
    boxes = np.array([(part.left, part.top, part.left + part.width, part.top + part.height) for part in raster.parts], dtype=np.float64)
    under = [k for k, box in enumerate(boxes) if covered_share(tuple(box), boxes[k + 1 :]) >= UNDER]
    if under:
        below = raster.parts[under[0]]
        above = next(part for k, part in reversed(list(enumerate(raster.parts))) if covered_share(tuple(boxes[under[0]]), boxes[k : k + 1]) > 0)
        example = f"{below.path.name} under {above.path.name}, which is {above.reason_above(below)}"
        found.append(finding("raster-under-others", len(under), example))
    return found
