"""Detects the format of a file from its content, not from its name."""

import re
from pathlib import Path
from typing import Final, Literal

from map3d.errors import NotFound, UnknownFormat

Format = Literal["citygml", "obj", "raster"]

READABLE_FORMATS: Final = "CityGML (.gml, .xml), Wavefront OBJ (.obj), elevation and image rasters (.tif)"
_HEAD_BYTES: Final = 1 << 16
_OBJ_LINE: Final = re.compile(rb"(v|vt|vn|vp|f|l|p|o|g|s|mtllib|usemtl)(\s|$)")
_TIFF: Final = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_BYTE_ORDER_MARKS: Final = ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be"))
_UNREADABLE: Final = {
    b"glTF": "glTF (binary)",
    b"PK\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "a gzip file",
    b"LASF": "a LAS point cloud",
    b"\x89PNG": "a PNG image",
}


def detect_format(path: Path) -> Format:
    """Raises NotFound, or UnknownFormat with the list of readable formats."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise NotFound(f"{path}: cannot read the file: {error.strerror}") from error
    format = _detect(head)
    if format is None:
        raise UnknownFormat(f"{path}: {_describe_unknown(head)}; map3d reads {READABLE_FORMATS}")
    return format


def _detect(head: bytes) -> Format | None:
    if head.startswith(_TIFF):
        return "raster"
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


def _describe_unknown(head: bytes) -> str:
    if not head:
        return "an empty file"
    for magic, name in _UNREADABLE.items():
        if head.startswith(magic):
            return name
    text = _to_utf8(head).lstrip()
    if text.startswith(b"<"):
        root = _find_root_element(text)
        return f"XML with root element {root.decode('utf-8', 'replace')}" if root else "XML without a root element"
    if text.startswith(b"{"):
        return "JSON"
    return "a file of unknown format"
