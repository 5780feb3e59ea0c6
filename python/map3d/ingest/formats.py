"""Detects the format of a file from its content, not from its name."""

import re
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from map3d.errors import NotFound, UnknownFormat
from map3d.ingest.gzip_file import is_gzip, unpacked_head

Format = Literal["citygml", "obj", "raster"]

READABLE_FORMATS: Final = (
    "CityGML (.gml, .xml), Wavefront OBJ (.obj), elevation and image rasters (.tif, .jp2, .asc; .jpg and .png with a world file)"
)
_HEAD_BYTES: Final = 1 << 16
_OBJ_LINE: Final = re.compile(rb"(v|vt|vn|vp|f|l|p|o|g|s|mtllib|usemtl)(\s|$)")
_BYTE_ORDER_MARKS: Final = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))
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
    text = _to_utf8(head).lstrip()
    return text.startswith(b"<") and _find_root_element(text) == b"VRTDataset"


def check_stored(path: Path) -> None:
    """Checks that reading the file ends: it is a regular file whose content is stored. Raises UnknownFormat, OSError."""
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        raise UnknownFormat(f"{path}: not a file but {_KINDS.get(stat.S_IFMT(status.st_mode), 'something else')}")
    stored = status.st_blocks * _BLOCK_BYTES
    if status.st_size > _MAX_SPARSE_BYTES and stored < status.st_size * _MIN_STORED:
        raise UnknownFormat(f"{path}: a sparse file of {status.st_size:,} bytes, of which only {stored:,} are stored")


def detect_format(path: Path, *, virtual: bool = False) -> Format:
    """Returns the format of a file, or of what a gzip file holds. `virtual`: virtual rasters are rasters, too.

    Raises NotFound, or UnknownFormat with the list of readable formats.
    """
    try:
        check_stored(path)
        packed = is_gzip(path)
        head = unpacked_head(path, _HEAD_BYTES) if packed else _read_head(path)
    except OSError as error:
        raise NotFound(f"{path}: cannot read the file: {error.strerror}") from error
    if virtual and not packed and is_virtual_raster(head):
        return "raster"
    format = _detect(path, head)
    if format is None or (packed and format == "raster"):
        content = "a raster; unpack it first" if format else _describe_unknown(path, head)
        raise UnknownFormat(f"{path}: {'a gzip file of ' if packed else ''}{content}; map3d reads {READABLE_FORMATS}")
    return format


def has_world_file(path: Path, head: bytes) -> bool:
    """Whether an image has a world file beside it. `head`: the first bytes of the image."""
    format = find_raster_format(head)
    if format is None or not format.is_image:
        return False
    return any(path.with_suffix(case(suffix)).is_file() for suffix in format.world_files for case in (str.lower, str.upper))


def _read_head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)


def _detect(path: Path, head: bytes) -> Format | None:
    raster = find_raster_format(head)
    if raster is not None:
        return None if raster.is_image and not has_world_file(path, head) else "raster"
    text = _to_utf8(head).lstrip()
    if text.startswith(b"<"):
        return "citygml" if _find_root_element(text) == b"CityModel" else None
    return "obj" if b"\0" not in head and _looks_like_obj(text) else None


def _to_utf8(head: bytes) -> bytes:
    """Decodes the Unicode encoding that the byte order mark announces."""
    for mark, encoding in _BYTE_ORDER_MARKS:
        if head.startswith(mark):
            return head[len(mark) :].decode(encoding, "replace").encode()
    return head


def _find_root_element(text: bytes) -> bytes | None:
    """Returns the local name of the first element."""
    rest = re.sub(rb"<!--.*?-->", b"", text, flags=re.DOTALL)
    match = re.search(rb"<(?:[\w.-]+:)?([\w.-]+)", rest)
    return match[1] if match else None


def _looks_like_obj(text: bytes) -> bool:
    """Accepts up to 10 % unknown keywords."""
    lines = [line.strip() for line in text.splitlines()[:-1] or text.splitlines()]
    lines = [line for line in lines if line and not line.startswith(b"#")]
    known = sum(_OBJ_LINE.match(line) is not None for line in lines)
    return known > 0 and known * 10 >= len(lines) * 9


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
    text = _to_utf8(head).lstrip()
    if text.startswith(b"<"):
        root = _find_root_element(text)
        if root == b"VRTDataset":
            return VIRTUAL_REFUSED
        return f"XML with root element {root.decode('utf-8', 'replace')}" if root else "XML without a root element"
    if text.startswith(b"{"):
        return "JSON"
    return "a file of unknown format"
