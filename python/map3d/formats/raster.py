"""Rasters of elevation and imagery, as their row in the list of formats. GDAL reads them."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d import _core
from map3d.formats.source_format import GIB, SourceFormat


@dataclass(frozen=True)
class RasterFormat:
    """`driver`: the one of GDAL. `signature`: the first bytes of a file. `suffixes`: those that announce a raster. `is_image`: a file is a raster
    only with a world file beside it."""

    driver: str
    signature: re.Pattern[bytes]
    suffixes: tuple[str, ...] = ()
    world_files: tuple[str, ...] = ()
    is_image: bool = False


RASTER_FORMATS: Final = (
    RasterFormat("GTiff", re.compile(rb"II[*+]\0|MM\0[*+]"), (".tif", ".tiff"), (".tfw", ".tifw", ".tiffw", ".wld")),
    RasterFormat("JP2OpenJPEG", re.compile(rb"\0\0\0\x0cjP  |\xffO\xffQ"), (".jp2",), (".j2w", ".jp2w", ".wld")),
    RasterFormat("AAIGrid", re.compile(rb"ncols\s+\d", re.IGNORECASE), (".asc",)),
    RasterFormat("JPEG", re.compile(rb"\xff\xd8\xff"), world_files=(".jgw", ".jpgw", ".jpegw", ".wld"), is_image=True),
    RasterFormat("PNG", re.compile(rb"\x89PNG"), world_files=(".pgw", ".pngw", ".wld"), is_image=True),
)
"""Rasters that are read from any place. Virtual rasters are not among them, since they could read any file: see map3d.ingest.virtual_raster."""

VIRTUAL_DRIVER: Final = "VRT"
VIRTUAL_REFUSED: Final = "a virtual raster, which map3d reads only on its own command line (map3d add-files); convert it with gdal_translate -of COG"


def find_raster_format(head: bytes) -> RasterFormat | None:
    """Returns the format of a raster or an image. `head`: the first bytes of a file."""
    return next((format for format in RASTER_FORMATS if format.signature.match(head)), None)


def is_virtual_raster(head: bytes) -> bool:
    """`head`: the first bytes of a file."""
    return _core.xml_root(head) == "VRTDataset"


def has_world_file(path: Path, head: bytes) -> bool:
    """Whether an image has a world file beside it. `head`: the first bytes of the image."""
    format = find_raster_format(head)
    if format is None or not format.is_image:
        return False
    return any(path.with_suffix(case(suffix)).is_file() for suffix in format.world_files for case in (str.lower, str.upper))


def _find_places(path: Path) -> set[Path]:
    """Returns the world file, the coordinate system and the metadata of GDAL beside a raster."""
    suffixes = (".prj", ".aux.xml", *(suffix for format in RASTER_FORMATS for suffix in format.world_files))
    names = [path.with_suffix(case(suffix)) for suffix in suffixes for case in (str.lower, str.upper)]
    return {place for place in [*names, path.with_name(f"{path.name}.aux.xml")] if place.is_file()}


def _detect(head: bytes, path: Path) -> bool:
    format = find_raster_format(head)
    return format is not None and (not format.is_image or has_world_file(path, head))


RASTER: Final = SourceFormat(
    name="raster",
    title="Terrain",
    readable="elevation and image rasters (.tif, .jp2, .asc; .jpg and .png with a world file)",
    uploads="GeoTIFF",
    version=6,
    detect=_detect,
    parser="map3d.ingest.terrain.parse_terrain:open_terrain_parser",
    suffixes=tuple(suffix for format in RASTER_FORMATS for suffix in format.suffixes),
    companions=(".prj", *(suffix for format in RASTER_FORMATS for suffix in format.world_files)),
    detect_companion=lambda head, path: has_world_file(path, head),
    sparse_options=("max_error_m", "elevation"),
    find_places=_find_places,
    is_grouped=True,
    has_checkpoints=True,
    cpu_s=600,
    memory_bytes=2 * GIB,
)
