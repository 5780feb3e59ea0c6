"""Which format a file has, by what is in it, not by its name."""

import re
from pathlib import Path
from typing import Final, Literal

from map3d.errors import NotFound, UnknownFormat

Format = Literal["citygml", "obj", "raster"]

KNOWN: Final = "CityGML (.gml, .xml), Wavefront OBJ (.obj), rasters of elevation and imagery (.tif)"
_LOOK_BYTES: Final = 1 << 16
_OBJ_LINE: Final = re.compile(rb"(v|vt|vn|vp|f|l|p|o|g|s|mtllib|usemtl)(\s|$)")
_TIFF: Final = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_OTHERS: Final = {
    b"glTF": "glTF (binary)",
    b"PK\x03\x04": "a ZIP archive",
    b"\x1f\x8b": "a gzip file",
    b"LASF": "a LAS point cloud",
    b"\x89PNG": "a PNG image",
}


def detect_format(path: Path) -> Format:
    """Raises UnknownFormat, naming the known ones; NotFound."""
    try:
        with path.open("rb") as file:
            head = file.read(_LOOK_BYTES)
    except OSError as error:
        raise NotFound(f"{path}: cannot be read: {error.strerror}") from error
    found = _sniff(head)
    if found is None:
        raise UnknownFormat(f"{path}: {_what(head)}; map3d reads {KNOWN}")
    return found


def _sniff(head: bytes) -> Format | None:
    if head.startswith(_TIFF):
        return "raster"
    text = _as_text(head).lstrip()
    if text.startswith(b"<"):
        return "citygml" if _root(text) == b"CityModel" else None
    return "obj" if b"\0" not in head and _looks_like_obj(text) else None


def _as_text(head: bytes) -> bytes:
    """UTF-8, whatever Unicode encoding its mark says."""
    for mark, encoding in ((b"\xef\xbb\xbf", "utf-8"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if head.startswith(mark):
            return head[len(mark) :].decode(encoding, "replace").encode()
    return head


def _root(text: bytes) -> bytes | None:
    """Local name of the first element."""
    rest = re.sub(rb"<!--.*?-->", b"", text, flags=re.DOTALL)
    match = re.search(rb"<(?:[\w.-]+:)?([\w.-]+)", rest)
    return match[1] if match else None


def _looks_like_obj(text: bytes) -> bool:
    """Nine in ten of the lines that say something begin with a word of the format."""
    lines = [line.strip() for line in text.splitlines()[:-1] or text.splitlines()]
    lines = [line for line in lines if line and not line.startswith(b"#")]
    known = sum(_OBJ_LINE.match(line) is not None for line in lines)
    return known > 0 and known * 10 >= len(lines) * 9


def _what(head: bytes) -> str:
    if not head:
        return "an empty file"
    for magic, name in _OTHERS.items():
        if head.startswith(magic):
            return name
    text = _as_text(head).lstrip()
    if text.startswith(b"<"):
        root = _root(text)
        return f"XML with the root {root.decode('utf-8', 'replace')}" if root else "XML without a root element"
    if text.startswith(b"{"):
        return "JSON"
    return "a file of unknown type"
