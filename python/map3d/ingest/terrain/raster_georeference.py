"""Where a raster lies: from its pixels to the scene's CRS and to another raster's pixels. Only the plane is reprojected, heights stay."""

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
from map3d.ingest.crs import horizontal

Array = NDArray[np.float64]
DRIVERS: Final = {
    b"II*\0": "GTiff",
    b"MM\0*": "GTiff",
    b"II+\0": "GTiff",
    b"MM\0+": "GTiff",
    b"\0\0\0\x0cjP  ": "JP2OpenJPEG",
    b"\xffO\xffQ": "JP2OpenJPEG",
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"ncols": "AAIGrid",
}
"""First bytes → GDAL driver. Only formats that name no further files: a virtual raster could read whatever its author likes."""


def open_raster(path: Path) -> Any:
    """An open rasterio dataset with a place on the ground; raises NotFound, ImportFailed."""
    if not path.is_file():
        raise NotFound(f"{path}: no such raster")
    driver = _driver(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", NotGeoreferencedWarning)
            dataset = rasterio.open(path, driver=driver)
    except NotGeoreferencedWarning as error:
        raise ImportFailed(f"{path}: the raster does not say where it lies; give it a georeference (gdal_translate -a_ullr)") from error
    except (RasterioError, OSError) as error:
        raise ImportFailed(f"{path}: not a {driver} raster, or damaged: {error}") from error
    if dataset.count < 1 or dataset.transform.is_degenerate:
        dataset.close()
        raise ImportFailed(f"{path}: the raster has no bands, or its pixels no area")
    return dataset


def _driver(path: Path) -> str:
    with path.open("rb") as file:
        head = file.read(16)
    for first, driver in DRIVERS.items():
        if head.lower().startswith(first) if first.isalpha() else head.startswith(first):
            return driver
    raise ImportFailed(f"{path}: not a raster that map3d reads ({', '.join(sorted(set(DRIVERS.values())))}); convert it with gdal_translate -of COG")


def crs_of(dataset: Any, scene_crs: CRS | None) -> CRS | None:
    """The raster's own horizontal CRS, the scene's when it has none; None in a local scene. Raises CrsError."""
    try:
        own = None if dataset.crs is None else CRS.from_user_input(dataset.crs)
    except ProjError as error:
        raise CrsError(f"{dataset.name}: unknown CRS: {error}") from error
    if scene_crs is None and own is not None and own.is_geographic:
        raise CrsError(f"{dataset.name}: is in degrees ({own.name}), the scene in metres of no known CRS; give the scene a projected CRS (--crs)")
    return scene_crs if own is None or scene_crs is None else horizontal(own)


class Place:
    """A raster's pixel positions (row, column; 0 the upper or left edge) in the plane of its CRS."""

    def __init__(self, dataset: Any, crs: CRS | None) -> None:
        self._affine = dataset.transform
        self.crs = crs

    def plane_from_pixels(self, rows: Array, columns: Array) -> tuple[Array, Array]:
        a, b, c, d, e, f = self._affine[:6]
        return c + columns * a + rows * b, f + columns * d + rows * e

    def pixels_from_plane(self, x: Array, y: Array) -> tuple[Array, Array]:
        """(rows, columns)."""
        a, b, c, d, e, f = (~self._affine)[:6]
        return f + x * d + y * e, c + x * a + y * b


class WayTo:
    """Coordinates of one CRS in another; infinite where that has none. Raises CrsError when there is no way."""

    def __init__(self, source: CRS | None, target: CRS | None) -> None:
        self._transformer: Transformer | None = None
        target = None if target is None else horizontal(target)
        if source is None or target is None or source.equals(target):
            return
        try:
            self._transformer = Transformer.from_crs(source, target, always_xy=True)
        except ProjError as error:
            raise CrsError(f"no way from {source.name} to {target.name}: {error}") from error

    @property
    def description(self) -> str:
        return "none: the same system" if self._transformer is None else str(self._transformer.description)

    def __call__(self, x: Array, y: Array) -> tuple[Array, Array]:
        if self._transformer is None:
            return x, y
        across, up = self._transformer.transform(x, y)
        return np.asarray(across, dtype=np.float64), np.asarray(up, dtype=np.float64)
