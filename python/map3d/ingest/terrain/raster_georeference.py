"""Georeferencing of rasters: from pixels to the scene's CRS and to the pixels of another raster. Only x and y are transformed, never heights."""

import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np
import rasterio
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError as ProjError
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from map3d.errors import CrsError, ImportFailed, NotFound
from map3d.formats.raster import RASTER_FORMATS, VIRTUAL_DRIVER, VIRTUAL_REFUSED, find_raster_format, is_virtual_raster
from map3d.geometry.crs import horizontal_crs, is_local, parse_crs
from map3d.geometry.transformations import LonLat, Transformation, find_transformation
from map3d.ingest.virtual_raster import is_checked

Array = NDArray[np.float64]
_HEAD_BYTES: Final = 4096


def open_raster(path: Path) -> Any:
    """Opens a georeferenced raster with rasterio; of virtual ones those that this process has checked. Raises NotFound, ImportFailed."""
    if not path.is_file():
        raise NotFound(f"{path}: no such raster")
    driver = find_driver(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", NotGeoreferencedWarning)
            dataset = rasterio.open(path, driver=driver)
    except NotGeoreferencedWarning as error:
        raise ImportFailed(f"{path}: the raster has no georeference; add one with gdal_translate -a_ullr") from error
    except (RasterioError, OSError) as error:
        raise ImportFailed(f"{path}: not a valid {driver} raster: {error}") from error
    if dataset.count < 1 or dataset.transform.is_degenerate:
        dataset.close()
        raise ImportFailed(f"{path}: the raster has no bands, or its pixels have no area")
    return dataset


def find_driver(path: Path) -> str:
    """Returns GDAL's driver for a raster that may be read. Raises ImportFailed."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if is_virtual_raster(head):
        if not is_checked(path):
            raise ImportFailed(f"{path}: {VIRTUAL_REFUSED}")
        return VIRTUAL_DRIVER
    format = find_raster_format(head)
    if format is None:
        names = ", ".join(sorted(format.driver for format in RASTER_FORMATS))
        raise ImportFailed(f"{path}: unknown raster format; map3d reads {names}; convert it with gdal_translate -of COG")
    return format.driver


def own_crs(dataset: Any, stated_crs: str | None = None) -> CRS | None:
    """Returns the CRS that the user states, else the file's; None for "local" and for a file without one. Raises CrsError."""
    if stated_crs is not None:
        return None if is_local(stated_crs) else parse_crs(stated_crs)
    try:
        return None if dataset.crs is None else CRS.from_user_input(dataset.crs)
    except ProjError as error:
        raise CrsError(f"{dataset.name}: unknown CRS: {error}") from error


def raster_crs(dataset: Any, scene_crs: CRS | None, stated_crs: str | None = None) -> CRS | None:
    """Returns the raster's horizontal CRS; the scene's if the raster has none; None in a local scene. Raises CrsError."""
    own = own_crs(dataset, stated_crs)
    if scene_crs is None and own is not None and own.is_geographic:
        raise CrsError(
            f"{dataset.name}: the raster is in degrees ({own.name}), but the scene is in local metres; give the scene a projected CRS (--crs)"
        )
    return scene_crs if own is None or scene_crs is None else horizontal_crs(own)


def place_of(dataset: Any, crs: CRS | None) -> LonLat | None:
    """Returns longitude and latitude of the middle of a raster; None if it is nowhere on Earth."""
    if crs is None:
        return None
    a, b, c, d, e, f = dataset.transform[:6]
    column, row = dataset.width / 2, dataset.height / 2
    middle = c + column * a + row * b, f + column * d + row * e
    lon, lat = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(*middle)
    return (float(lon), float(lat)) if abs(lon) <= 360.0 and abs(lat) <= 90.0 else None


class RasterGeoreference:
    """Converts between pixel positions (row, column; 0 is the upper or left edge) and the plane of the raster's CRS."""

    def __init__(self, dataset: Any, crs: CRS | None) -> None:
        self._affine = dataset.transform
        self.crs = crs

    def plane_from_pixels(self, rows: Array, columns: Array) -> tuple[Array, Array]:
        a, b, c, d, e, f = self._affine[:6]
        return c + columns * a + rows * b, f + columns * d + rows * e

    def pixels_from_plane(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Returns (rows, columns)."""
        a, b, c, d, e, f = (~self._affine)[:6]
        return f + x * d + y * e, c + x * a + y * b


class PlaneTransformer:
    """Transforms x and y between two CRSs; infinite outside the target's range. Without either CRS, coordinates stay unchanged."""

    def __init__(self, source: CRS | None, target: CRS | None, place: LonLat | None = None) -> None:
        """`place`: of the raster. Raises CrsError if no transformation is known."""
        self.transformation: Transformation | None = None
        if source is not None and target is not None and not source.equals(horizontal_crs(target)):
            self.transformation = find_transformation(source, target, place)

    @property
    def report(self) -> dict[str, Any]:
        """Returns what import reports say of it."""
        return {"operation": "none: same CRS"} if self.transformation is None else self.transformation.report

    def __call__(self, x: Array, y: Array) -> tuple[Array, Array]:
        return (x, y) if self.transformation is None else self.transformation(x, y)
