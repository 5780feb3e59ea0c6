"""Several rasters of one kind as one: a grid of pixels over all of them, whose windows are read from the rasters that cover them.

The grid continues the pixels of the finest raster. Rasters on it are read as they are; others, of another resolution, CRS or offset, are resampled.
Of rasters at one place, the one of the better kind is on top, then the finer, the newer, and the first by name.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from pyproj import CRS
from rasterio.enums import ColorInterp, MaskFlags, Resampling
from rasterio.errors import RasterioError
from rasterio.vrt import WarpedVRT
from rasterio.windows import Window

from map3d.errors import ImportFailed, LimitExceeded
from map3d.geometry.crs import horizontal_crs
from map3d.ingest.terrain.damaged_reads import Damage
from map3d.ingest.terrain.height_voids import HeightVoids
from map3d.ingest.terrain.orthophoto import Colours, Mask, Orthophoto
from map3d.ingest.terrain.photo_margin import PhotoMargins
from map3d.ingest.terrain.photo_values import ValueRange, find_colour_bands, find_range, is_whole, sample_values, significant_bits
from map3d.ingest.terrain.raster_dates import date_in_name, date_in_tags
from map3d.ingest.terrain.raster_georeference import Array, PlaneTransformer, RasterGeoreference, open_raster, own_crs, place_of
from map3d.ingest.terrain.vertex_grid import RasterHeightField, read_metres

OPEN_RASTERS: Final = 32
MAX_SIDE_PX: Final = 1 << 31
MAX_SAMPLES: Final = 64
"""Rasters from which the range of values is sampled."""

EDGE_POINTS: Final = 33
_ALIGNED_PX: Final = 1e-3
_SAME_SIZE: Final = 1e-9
_PLANE: Final = CRS.from_epsg(3857)
"""Stands for the CRS of rasters without one where GDAL demands one: from it to itself coordinates stay unchanged."""


@dataclass(frozen=True)
class MosaicPart:
    """A raster and the rectangle that it covers, in pixels of the mosaic. `on_grid`: its pixels are the mosaic's. `rank`: parts of a lower one are on
    top; `date`: when it was taken, empty if unknown."""

    path: Path
    left: int
    top: int
    width: int
    height: int
    pixel: float
    on_grid: bool
    rank: int = 0
    date: str = ""

    def reason_above(self, other: "MosaicPart") -> str:
        """Returns why this part lies above another one."""
        if self.rank != other.rank:
            return "better by its kind"
        if self.pixel != other.pixel:
            return "finer"
        return "newer" if self.date != other.date else "first by name"


@dataclass(frozen=True)
class PartWindow:
    """Pixels of an opened raster, and where they are in the window that was asked for."""

    part: MosaicPart
    dataset: Any
    window: Window
    rows: slice
    columns: slice


class RasterMosaic:
    """Has the attributes of a rasterio dataset that the terrain import needs: name, crs, transform, width, height. Context manager."""

    def __init__(self, paths: Sequence[Path], stated_crs: str | None, min_pixel: float = 0.0, ranks: Mapping[Path, int] | None = None) -> None:
        """`stated_crs`: the user's choice for all rasters; `min_pixel`: the least size of a pixel, in units of the CRS; `ranks`: of kinds of rasters.

        Raises ImportFailed, CrsError, LimitExceeded.
        """
        self._stated, self._ranks = stated_crs, ranks or {}
        self._opened: OrderedDict[Path, tuple[Any, Any]] = OrderedDict()
        self.voids = HeightVoids()
        self.crs = next((crs for crs in map(self._own_crs, paths) if crs is not None), None)
        self._dates = _dates(paths)
        grids = [self._grid_of(path) for path in paths]
        finest = min(grids, key=lambda grid: grid[0].a)[0]
        self.pixel = max(finest.a, min_pixel)
        self.pixels = sorted({round(grid[0].a, 9) for grid in grids})
        bounds = np.array([(t.c, t.f, t.c + t.a * width, t.f + t.e * height) for t, width, height, _ in grids])
        west, north = float(bounds[:, 0].min()), float(bounds[:, 1].max())
        west = finest.c + math.floor((west - finest.c) / self.pixel + _ALIGNED_PX) * self.pixel
        north = finest.f + math.ceil((north - finest.f) / self.pixel - _ALIGNED_PX) * self.pixel
        self.transform = Affine(self.pixel, 0.0, west, 0.0, -self.pixel, north)
        parts = [self._place(path, grid) for path, grid in zip(paths, grids, strict=True)]
        by_name = sorted(parts, key=lambda part: str(part.path), reverse=True)
        self.parts = sorted(by_name, key=lambda part: (-part.rank, -part.pixel, part.date))
        """The lowest first, so that those above replace its pixels."""
        self.width, self.height = max(part.left + part.width for part in parts), max(part.top + part.height for part in parts)
        self.name = str(paths[0])
        if max(self.width, self.height) > MAX_SIDE_PX:
            raise LimitExceeded(f"{self.name}: the {len(paths)} rasters lie too far apart for one terrain; import them one by one")

    @property
    def covered_pixels(self) -> int:
        """Returns the number of pixels of all parts; overlaps count twice."""
        return sum(part.width * part.height for part in self.parts)

    def covers(self, left: float, top: float, right: float, bottom: float) -> bool:
        """Whether a rectangle of pixels touches a part."""
        return any(part.left < right and part.top < bottom and left < part.left + part.width and top < part.top + part.height for part in self.parts)

    def windows(self, window: Window) -> Iterator[PartWindow]:
        """Yields the pixels of each part in a window, from the lowest part to the uppermost."""
        x0, y0, x1, y1 = window.col_off, window.row_off, window.col_off + window.width, window.row_off + window.height
        for part in self.parts:
            left, top = max(x0, part.left), max(y0, part.top)
            right, bottom = min(x1, part.left + part.width), min(y1, part.top + part.height)
            if left < right and top < bottom:
                inside = Window(left - part.left, top - part.top, right - left, bottom - top)
                yield PartWindow(part, self.open(part), inside, slice(top - y0, bottom - y0), slice(left - x0, right - x0))

    def open(self, part: MosaicPart) -> Any:
        """Returns the dataset of a part, whose pixels are the mosaic's; the mosaic closes it."""
        if part.path in self._opened:
            self._opened.move_to_end(part.path)
            return self._opened[part.path][1]
        source = open_raster(part.path)
        dataset = source if part.on_grid else self._resampled(source, part)
        self._opened[part.path] = (source, dataset)
        while len(self._opened) > OPEN_RASTERS:
            _close(*self._opened.popitem(last=False)[1])
        return dataset

    def source(self, part: MosaicPart) -> Any:
        """Returns the dataset of a part as it is in the file."""
        self.open(part)
        return self._opened[part.path][0]

    def reopen(self) -> Self:
        """Returns the same mosaic for another thread: it opens rasters of its own."""
        other = copy(self)
        other._opened = OrderedDict()
        return other

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while self._opened:
            _close(*self._opened.popitem()[1])

    def _own_crs(self, path: Path) -> CRS | None:
        with open_raster(path) as raster:
            own = own_crs(raster, self._stated)
        return None if own is None else horizontal_crs(own)

    def _grid_of(self, path: Path) -> tuple[Affine, int, int, bool]:
        """Returns the north-up transform, width and height of a raster in the mosaic's CRS, and whether these are its own."""
        own = self._own_crs(path) or self.crs
        with open_raster(path) as raster:
            t, same_crs = raster.transform, own is None or self.crs is None or own.equals(self.crs, ignore_axis_order=True)
            if same_crs and t.b == t.d == 0.0 and t.a > 0.0 > t.e and math.isclose(t.a, -t.e, rel_tol=_SAME_SIZE):
                return t, raster.width, raster.height, True
            to_mosaic = PlaneTransformer(own, self.crs, place_of(raster, own))
            edges = [to_mosaic(*_edge(raster)), to_mosaic(*_centre_pixel(raster))]
        # GDAL resamples, and knows no transformations in several steps.
        in_steps = to_mosaic.transformation is not None and len(to_mosaic.transformation.steps) > 1
        if in_steps or not all(np.isfinite(edge).all() for edge in edges):
            raise ImportFailed(f"{path}: cannot be transformed to the CRS of the first raster; import it on its own")
        (x, y), (px, py) = edges
        pixel = float(min(np.hypot(px[1] - px[0], py[1] - py[0]), np.hypot(px[2] - px[0], py[2] - py[0])))
        transform = Affine(pixel, 0.0, float(x.min()), 0.0, -pixel, float(y.max()))
        return transform, math.ceil((x.max() - x.min()) / pixel), math.ceil((y.max() - y.min()) / pixel), False

    def _place(self, path: Path, grid: tuple[Affine, int, int, bool]) -> MosaicPart:
        transform, width, height, own_grid = grid
        left, top = (transform.c - self.transform.c) / self.pixel, (self.transform.f - transform.f) / self.pixel
        scale = transform.a / self.pixel
        same_size = abs(scale - 1.0) * max(width, height) < _ALIGNED_PX
        kind = self._ranks.get(path, 0), self._dates[path]
        if own_grid and same_size and all(abs(offset - round(offset)) < _ALIGNED_PX for offset in (left, top)):
            return MosaicPart(path, round(left), round(top), width, height, transform.a, True, *kind)
        x0, y0 = math.floor(left + _ALIGNED_PX), math.floor(top + _ALIGNED_PX)
        x1, y1 = math.ceil(left + width * scale - _ALIGNED_PX), math.ceil(top + height * -transform.e / self.pixel - _ALIGNED_PX)
        return MosaicPart(path, x0, y0, max(x1 - x0, 1), max(y1 - y0, 1), transform.a, False, *kind)

    def _resampled(self, source: Any, part: MosaicPart) -> WarpedVRT:
        own, target = self._own_crs(part.path) or self.crs, self.crs
        is_image = source.dtypes[0] == "uint8" or source.count in (3, 4)
        void = None if is_image else self.voids.of(part.path, source)
        has_mask = source.nodata is not None or any(MaskFlags.all_valid not in flags for flags in source.mask_flag_enums)
        return WarpedVRT(
            source,
            src_crs=(own or _PLANE).to_wkt(),
            crs=(target or _PLANE).to_wkt(),
            transform=self.transform @ Affine.translation(part.left, part.top),
            width=part.width,
            height=part.height,
            resampling=Resampling.nearest if source.colorinterp[0] is ColorInterp.palette else Resampling.bilinear,
            **({} if void is None else {"src_nodata": void}),
            **(({} if has_mask else {"add_alpha": True}) if is_image else {"dtype": "float64", "nodata": math.nan}),
        )


class MosaicHeightField(RasterHeightField):
    """Heights of a mosaic of elevation models, each in its own unit."""

    def __init__(self, mosaic: RasterMosaic, metres_per_unit: Callable[[Any], float], damage: Damage | None = None) -> None:
        """`metres_per_unit`: of a dataset."""
        super().__init__(mosaic, 1.0, scale=(1.0, 0.0), damage=damage)
        self._mosaic = mosaic
        self._scales: dict[Path, tuple[float, float]] = {}
        self._metres_per_unit = metres_per_unit

    def _read_window(self, window: Window) -> NDArray[np.float64]:
        data = np.full((window.height, window.width), np.nan)
        for piece in self._mosaic.windows(window):
            # A resampled part has none of its void values any more.
            void = self._mosaic.voids.of(piece.part.path, self._mosaic.source(piece.part)) if piece.part.on_grid else None
            heights, implausible = read_metres(piece.dataset, piece.window, self._scale_of(piece.part), self._damage, str(piece.part.path), void)
            self.implausible += implausible
            known = np.isfinite(heights)
            data[piece.rows, piece.columns][known] = heights[known]
        return data

    def _scale_of(self, part: MosaicPart) -> tuple[float, float]:
        if part.path not in self._scales:
            source = self._mosaic.source(part)
            unit = self._metres_per_unit(source)
            self._scales[part.path] = (float(source.scales[0]) * unit, float(source.offsets[0]) * unit)
        return self._scales[part.path]


class MosaicPhoto(Orthophoto):
    """Colours of a mosaic of photos. Photos that are not of bytes share one range of values."""

    def __init__(
        self,
        mosaic: RasterMosaic,
        ground: tuple[int, int, int],
        max_side_px: int,
        value_range: ValueRange | None = None,
        margins: PhotoMargins | None = None,
        damage: Damage | None = None,
    ) -> None:
        self.dataset = mosaic
        self._ground = np.array(ground, dtype=np.uint8)
        self._max_side_px = max_side_px
        self._mosaic, self._margins, self._damage = mosaic, margins, damage or Damage(strict=True)
        self._photos: dict[Path, tuple[Any, Orthophoto]] = {}
        self.value_range = value_range or self._find_common_range()

    def _find_common_range(self) -> ValueRange:
        every = -(-len(self._mosaic.parts) // MAX_SAMPLES)
        samples, bits, whole_numbers = [], 0, True
        for part in self._mosaic.parts[::every]:
            source = self._mosaic.source(part)
            values = sample_values(source, len(self._mosaic.parts))
            if values is not None:
                bands = find_colour_bands(source)
                samples.append(values)
                bits, whole_numbers = max(bits, significant_bits(source, bands)), whole_numbers and is_whole(source, bands)
        return find_range(np.concatenate(samples), bits=bits, whole_numbers=whole_numbers) if samples else ValueRange()

    def _read_inside(self, window: Window, rows: int, columns: int) -> tuple[Colours, Mask]:
        colour, covered = np.zeros((rows, columns, 3), dtype=np.uint8), np.zeros((rows, columns), dtype=bool)
        for piece in self._mosaic.windows(window):
            r0, r1 = _scaled(piece.rows, rows / window.height, rows)
            c0, c1 = _scaled(piece.columns, columns / window.width, columns)
            part_colour, part_covered = self._photo_of(piece)._read_inside(piece.window, r1 - r0, c1 - c0)
            colour[r0:r1, c0:c1][part_covered] = part_colour[part_covered]
            covered[r0:r1, c0:c1] |= part_covered
        return colour, covered

    def _photo_of(self, piece: PartWindow) -> Orthophoto:
        known = self._photos.get(piece.part.path)
        if known is None or known[0] is not piece.dataset:
            is_bytes = self._mosaic.source(piece.part).dtypes[0] == "uint8"
            ground = (int(self._ground[0]), int(self._ground[1]), int(self._ground[2]))
            value_range = None if is_bytes else self.value_range
            margin = None if self._margins is None else self._margins.of(piece.part.path, piece.dataset, self._mosaic.source(piece.part))
            photo = Orthophoto(piece.dataset, ground, self._max_side_px, value_range, margin, self._damage, str(piece.part.path))
            known = (piece.dataset, photo)
            self._photos[piece.part.path] = known
        return known[1]


def _dates(paths: Sequence[Path]) -> dict[Path, str]:
    """Returns the dates in the names of rasters or, if no name has one, in their metadata."""
    named = {path: date_in_name(path) for path in paths}
    if any(named.values()):
        return named
    dates = {}
    for path in paths:
        with open_raster(path) as raster:
            dates[path] = date_in_tags(raster)
    return dates


def _scaled(span: slice, scale: float, count: int) -> tuple[int, int]:
    begin = min(round(span.start * scale), count - 1)
    return begin, min(max(round(span.stop * scale), begin + 1), count)


def _edge(raster: Any) -> tuple[Array, Array]:
    """Returns positions along the edge of a raster, in its CRS."""
    along, zero = np.linspace(0.0, 1.0, EDGE_POINTS), np.zeros(EDGE_POINTS)
    rows = np.concatenate([zero, zero + 1.0, along, along]) * raster.height
    columns = np.concatenate([along, along, zero, zero + 1.0]) * raster.width
    return RasterGeoreference(raster, None).plane_from_pixels(rows, columns)


def _centre_pixel(raster: Any) -> tuple[Array, Array]:
    """Returns the upper left, upper right and lower left corner of the pixel in the middle, in the raster's CRS."""
    row, column = raster.height // 2, raster.width // 2
    return RasterGeoreference(raster, None).plane_from_pixels(np.array([row, row, row + 1.0]), np.array([column, column + 1.0, column]))


def _close(source: Any, dataset: Any) -> None:
    with suppress(RasterioError):
        if dataset is not source:
            dataset.close()
        source.close()
