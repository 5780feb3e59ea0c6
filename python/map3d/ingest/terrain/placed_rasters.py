"""Rasters that a RasterRelief of CityGML places: one without a georeference of its own lies where the grid of the relief says.

GDAL reads such a raster through a virtual one (VRT) that has the georeference.
"""

import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple
from xml.sax.saxutils import escape

import numpy as np
import rasterio
import rasterio.shutil
from affine import Affine
from pyproj import CRS
from rasterio.errors import NotGeoreferencedWarning

from map3d.errors import CrsError, ImportFailed
from map3d.geometry.crs import is_local, parse_crs
from map3d.ingest.coordinate_check import CoordinateCheck
from map3d.ingest.evidence import Evidence
from map3d.ingest.findings import finding
from map3d.ingest.terrain.raster_georeference import Array, PlaneTransformer, find_driver, own_crs
from map3d.ingest.virtual_raster import check_virtual_raster

ELSEWHERE: Final = "RasterRelief: raster in another place than its grid, read in its own"
MAX_APART_PX: Final = 0.5


class _PixelTransform(NamedTuple):
    """Transform of pixel corners to positions, east first, and the CRS of these, or None."""

    transform: Affine
    crs: CRS | None


class PlacedRasters:
    """Context manager; at its end, the virtual rasters are removed."""

    def __init__(self, folder: Path, grids: Mapping[str, Mapping[str, Any]], stated_crs: str | None) -> None:
        """`folder`: a new one for virtual rasters; `grids`: path of a raster → the grid of its relief; `stated_crs`: the user's choice."""
        self._folder, self._grids, self._stated = folder, grids, stated_crs
        self.findings: list[dict[str, Any]] = []
        self.heights: set[Path] = set()
        """Paths at which the rasters of reliefs are read."""

    def __enter__(self) -> "PlacedRasters":
        return self

    def __exit__(self, *_: object) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)

    def place(self, path: Path) -> Path:
        """Returns the path at which the raster is read. Raises ImportFailed for one that its grid does not fit, CrsError for an unknown CRS."""
        grid = self._grids.get(str(path))
        if grid is None:
            return path
        found = self._place(path, grid)
        self.heights.add(found)
        return found

    def _place(self, path: Path, grid: Mapping[str, Any]) -> Path:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", NotGeoreferencedWarning)
            with rasterio.open(path, driver=find_driver(path)) as raster:
                place = _place_of(grid, self._stated)
                if raster.transform.is_identity and raster.crs is None:
                    return self._write(path, raster, place, grid)
                self._compare(path, raster, place)
                return self._write(path, raster, _PixelTransform(raster.transform, place.crs), None) if raster.crs is None and place.crs else path

    def _write(self, path: Path, raster: Any, place: _PixelTransform, grid: Mapping[str, Any] | None) -> Path:
        """Writes a virtual raster; its name is that of the raster, since messages name it."""
        if grid is not None and (raster.width, raster.height) != (grid["columns"], grid["rows"]):
            raise ImportFailed(
                f"{path}: {raster.width} × {raster.height} pixels, but the grid of its RasterRelief has {grid['columns']} × {grid['rows']} points"
            )
        virtual = self._folder / str(len(list(self._folder.glob("*")))) / path.name
        virtual.parent.mkdir(parents=True)
        rasterio.shutil.copy(raster, virtual, driver="VRT")
        head, mark, rest = virtual.read_text("utf-8").partition(">")
        numbers = ", ".join(repr(float(value)) for value in place.transform.to_gdal())
        crs = "" if place.crs is None else f"<SRS>{escape(place.crs.to_wkt())}</SRS>"
        virtual.write_text(f"{head}{mark}{crs}<GeoTransform>{numbers}</GeoTransform>{_without_place(rest)}", "utf-8")
        check_virtual_raster(virtual, path.resolve().parent)
        return virtual

    def _compare(self, path: Path, raster: Any, place: _PixelTransform) -> None:
        """Warns of a raster whose own georeference is another one than that of its grid."""
        own = own_crs(raster, self._stated)
        corners = np.array([(0.0, 0.0), (raster.width, 0.0), (0.0, raster.height), (raster.width, raster.height)]).T
        there = _apply(place.transform, corners)
        if place.crs is not None and own is not None:
            there = np.array(PlaneTransformer(place.crs, own)(*there))
        apart = float(np.hypot(*(there - _apply(raster.transform, corners))).max())
        if not apart <= MAX_APART_PX * max(map(abs, raster.res)):
            self.findings.append(finding("relief-raster-elsewhere", 1, f"{path.name}: {apart:,.6g} apart, in units of its CRS"))


def _apply(transform: Affine, pixels: Array) -> Array:
    """Returns (2, n) positions of (2, n) columns and rows."""
    a, b, c, d, e, f = transform[:6]
    return np.array([a * pixels[0] + b * pixels[1] + c, d * pixels[0] + e * pixels[1] + f])


def _without_place(text: str) -> str:
    """Removes the georeference from a virtual raster."""
    for tag in ("SRS", "GeoTransform"):
        head, mark, rest = text.partition(f"<{tag}")
        if mark:
            text = head + rest.partition(f"</{tag}>")[2]
    return text


def _place_of(grid: Mapping[str, Any], stated_crs: str | None) -> _PixelTransform:
    """Returns the place that a grid says. Its points are the centres of pixels."""
    first, column, row = (np.array(grid[name], dtype=np.float64) for name in ("first", "column_step", "row_step"))
    name = grid["crs"] if stated_crs is None else stated_crs
    crs = None if name is None or is_local(name) else parse_crs(name)
    if crs is not None:
        last = first + column * (grid["columns"] - 1) + row * (grid["rows"] - 1)
        points = np.column_stack([np.array([first, first + column, first + row, last]), np.zeros(4)])
        try:
            evidence = Evidence(axes=grid.get("axes", "auto"))
            ordered = CoordinateCheck(crs, name or "", stated=stated_crs is not None, evidence=evidence).ordered(points)[:, :2]
        except CrsError as error:
            raise CrsError(f"RasterRelief: {error}") from error
        if crs.is_geographic and crs.axis_info[0].direction == "north":
            ordered = ordered[:, ::-1]
        first, column, row = ordered[0], ordered[1] - ordered[0], ordered[2] - ordered[0]
    corner = first - (column + row) / 2
    return _PixelTransform(Affine(column[0], row[0], corner[0], column[1], row[1], corner[1]), crs)
