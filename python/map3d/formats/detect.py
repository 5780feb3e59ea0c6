"""Detects the format of a file from its content, not from its name."""

import json
import stat
from pathlib import Path
from typing import Final

from map3d import _core
from map3d.errors import NotFound, UnknownFormat
from map3d.formats import FORMATS
from map3d.formats.gzip_file import is_gzip, unpacked_head
from map3d.formats.raster import RASTER, VIRTUAL_REFUSED, find_raster_format, is_virtual_raster
from map3d.formats.source_format import SourceFormat
from map3d.messages import message

READABLE_FORMATS: Final = ", ".join(format.readable for format in FORMATS)
_UNREADABLE: Final = {
    b"glTF": "glTF (binary)",
    b"PK\x03\x04": "a ZIP archive",
    b"LASF": "a LAS point cloud",
}
_OTHER_RASTERS: Final = {
    ".ecw": "an ECW raster (GDAL driver ECW)",
    ".sid": "a MrSID raster (GDAL driver MrSID)",
    ".img": "a raster of ERDAS Imagine (GDAL driver HFA)",
    ".xyz": "a grid of points (GDAL driver XYZ)",
    ".bil": "an EHdr raster (GDAL driver EHdr)",
    ".hgt": "an SRTM raster (GDAL driver SRTMHGT)",
}
"""Suffixes of rasters that are not read, since they need other drivers or files."""
_KINDS: Final = {
    stat.S_IFIFO: "a named pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a folder",
}
_BLOCK_BYTES: Final = 512
_MAX_SPARSE_BYTES: Final = 1 << 30
_MIN_STORED: Final = 0.01
"""Share of a large file that is stored. Compressing file systems store at least this."""


def check_stored(path: Path) -> None:
    """Checks that reading the file ends: it is a regular file whose content is stored. Raises UnknownFormat, OSError."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise _unread(path, f"not a file but {_KINDS.get(stat.S_IFMT(status.st_mode), 'something else')}")
    stored = status.st_blocks * _BLOCK_BYTES
    if status.st_size > _MAX_SPARSE_BYTES and stored < status.st_size * _MIN_STORED:
        raise _unread(path, f"a sparse file of {status.st_size:,} bytes, of which only {stored:,} are stored")


def _unread(path: Path, content: str) -> UnknownFormat:
    return UnknownFormat(message("file-not-read", file=str(path), content=content))


def detect_format(path: Path, *, virtual: bool = False) -> SourceFormat:
    """Returns the format of a file, or of what a gzip file holds. `virtual`: virtual rasters are rasters, too.

    Raises NotFound, or UnknownFormat with the list of readable formats.
    """
    try:
        check_stored(path)
        packed = is_gzip(path)
        head = unpacked_head(path, _core.HEAD_BYTES) if packed else _read_head(path)
    except OSError as error:
        raise NotFound(f"{path}: cannot read the file: {error.strerror}") from error
    if virtual and not packed and is_virtual_raster(head):
        return RASTER
    format = next((format for format in FORMATS if format.detect(head, path)), None)
    if format is None or (packed and format is RASTER):
        content = "a raster; unpack it first" if format else _describe_unknown(path, head)
        said = {"file": str(path), "content": f"{'a gzip file of ' if packed else ''}{content}"}
        raise UnknownFormat(message("format-not-read", **said, formats=READABLE_FORMATS))
    return format


def _read_head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_core.HEAD_BYTES)


def _describe_unknown(path: Path, head: bytes) -> str:
    if not head:
        return "an empty file"
    if path.suffix.lower() in _OTHER_RASTERS:
        return f"{_OTHER_RASTERS[path.suffix.lower()]}; convert it with gdal_translate -of COG"
    if (raster := find_raster_format(head)) is not None:
        return f"a {raster.driver} image without a world file"
    for magic, name in _UNREADABLE.items():
        if head.startswith(magic):
            return f"{name}; unpack it first" if path.suffix.lower() == ".zip" else name
    root = _core.xml_root(head)
    if root is not None:
        return VIRTUAL_REFUSED if is_virtual_raster(head) else f"XML with root element {root}" if root else "XML without a root element"
    if head.decode(json.detect_encoding(head), "replace").lstrip().startswith("{"):
        return "JSON"
    return "a file of unknown format"
