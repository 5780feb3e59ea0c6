"""Virtual rasters (GDAL's VRT): XML that names other rasters, and could name any file, any address and code to run.

Only those are read that the operator of this host names, or that are in a folder that the operator names. What they may contain is listed here; their
sources are rasters of the formats that map3d reads, inside one folder.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element, ParseError, XMLParser

from map3d.errors import ImportFailed
from map3d.formats.raster import RASTER_FORMATS, find_raster_format, is_virtual_raster

MAX_BYTES: Final = 256_000_000
MAX_DEPTH: Final = 8
"""Virtual rasters whose sources are virtual."""

HEAD_BYTES: Final = 4096
_ELEMENTS: Final = {
    "VRTDataset", "SRS", "GeoTransform", "Metadata", "MDI", "VRTRasterBand", "ColorInterp", "NoDataValue", "HideNoDataValue", "ColorTable",
    "Entry", "CategoryNames", "Category", "Description", "UnitType", "Offset", "Scale", "Histograms", "HistItem", "HistMin", "HistMax",
    "BucketCount", "IncludeOutOfRange", "Approximate", "HistCounts", "SimpleSource", "ComplexSource", "AveragedSource", "SourceFilename",
    "SourceBand", "SourceProperties", "SrcRect", "DstRect", "NODATA", "ScaleOffset", "ScaleRatio", "Exponent", "SrcMin", "SrcMax", "DstMin",
    "DstMax", "LUT", "ColorTableComponent", "UseMaskBand", "Overview", "OverviewList", "MaskBand", "BlockXSize", "BlockYSize",
}  # fmt: skip
_SUBCLASSES: Final = (None, "", "VRTSourcedRasterBand")
_SOURCE: Final = re.compile(rb"<SourceFilename([^<>]{0,1024})>([^<>]{1,4096})</SourceFilename>")
_checked: Final[set[Path]] = set()


def check_virtual_raster(path: Path, root: Path) -> None:
    """Checks a virtual raster, and allows this process to open it. `root`: the folder in which its sources must be.

    Raises ImportFailed for anything but sources inside `root` in a format that map3d reads.
    """
    _check(path, root.resolve(), 0)
    _checked.add(path.resolve())


def is_checked(path: Path) -> bool:
    """Whether this process may open a virtual raster."""
    return path.resolve() in _checked


def find_virtual_sources(path: Path, root: Path) -> set[Path]:
    """Returns the files inside `root` that a virtual raster names, through virtual rasters, too. It only finds them; see `check_virtual_raster`."""
    found: set[Path] = set()
    waiting = [path.resolve()]
    while waiting:
        current = waiting.pop()
        if not is_virtual(current):
            continue
        new = {source for source in _named_files(current) if source.is_relative_to(root.resolve()) and source.is_file()} - found
        found |= new
        waiting += new
    return found - {path.resolve()}


def _named_files(path: Path) -> Iterator[Path]:
    if path.stat().st_size > MAX_BYTES:
        return
    for attributes, name in _SOURCE.findall(path.read_bytes()):
        try:
            yield _source_path(path, name.decode("utf-8", "replace").strip(), re.search(rb"relativeToVRT\s*=\s*[\"']1", attributes) is not None)
        except (OSError, ValueError):
            continue


def _source_path(path: Path, name: str, relative: bool) -> Path:
    return ((path.parent if relative else Path.cwd()) / name).resolve()


def is_virtual(path: Path) -> bool:
    """Whether a file is a virtual raster. Raises OSError."""
    with path.open("rb") as file:
        return is_virtual_raster(file.read(HEAD_BYTES))


def _check(path: Path, root: Path, depth: int) -> None:
    if depth > MAX_DEPTH:
        raise ImportFailed(f"{path}: virtual rasters of virtual rasters of … more than {MAX_DEPTH} times; convert it with gdal_translate -of COG")
    for element in _parse(path).iter():
        if element.tag not in _ELEMENTS or _subclass(element) not in _SUBCLASSES or "vrt_sources" in element.get("domain", ""):
            raise ImportFailed(f"{path}: {_refusal(element)}; convert it with gdal_translate -of COG")
        if element.tag == "SourceFilename":
            _check_source(path, element, root, depth)


def _parse(path: Path) -> Element:
    """Parses a document without a document type, whose entities could expand to anything, and without what GDAL could parse in another way."""
    if path.stat().st_size > MAX_BYTES:
        raise ImportFailed(f"{path}: {path.stat().st_size:,} bytes, the limit of a virtual raster is {MAX_BYTES:,}")
    text = path.read_bytes()
    if b"<!DOCTYPE" in text or b"<?" in text[5:] or b"\0" in text:
        raise ImportFailed(f"{path}: a virtual raster with a document type, instructions or zero bytes; write it again with gdalbuildvrt")
    parser = XMLParser()
    try:
        parser.feed(text)
        return parser.close()
    except (ParseError, ValueError, LookupError) as error:
        raise ImportFailed(f"{path}: a broken virtual raster: {error}") from error


def _attribute(element: Element, name: str) -> str | None:
    """Returns an attribute by its lower-case name: GDAL does not distinguish cases."""
    return next((value for key, value in element.items() if key.lower() == name), None)


def _subclass(element: Element) -> str | None:
    return _attribute(element, "subclass")


def _refusal(element: Element) -> str:
    subclass = _subclass(element)
    if subclass == "VRTDerivedRasterBand" or element.tag.startswith("PixelFunction"):
        return "a virtual raster with a pixel function, which map3d does not run"
    if subclass not in _SUBCLASSES:
        return f"a virtual raster of the kind {subclass}, which map3d does not read"
    return f"a virtual raster with the element {element.tag}, which map3d does not read"


def _check_source(path: Path, element: Element, root: Path, depth: int) -> None:
    name = (element.text or "").strip()
    if _attribute(element, "relativetovrt") not in (None, "0", "1"):
        raise ImportFailed(f"{path}: relativeToVRT is neither 0 nor 1; write the virtual raster again with gdalbuildvrt")
    if "://" in name or name.startswith("/vsi") or ":" in name or "<" in name or not name:
        raise ImportFailed(f"{path}: its source {name!r} is not the path of a file; map3d reads files only, without drivers, addresses or /vsi paths")
    try:
        source = _source_path(path, name, _attribute(element, "relativetovrt") == "1")
        is_file = source.is_file()
    except (OSError, ValueError) as error:
        raise ImportFailed(f"{path}: its source {name!r} cannot be found: {error}") from error
    if not source.is_relative_to(root):
        raise ImportFailed(f"{path}: its source {name!r} is outside the folder {root}; give a folder that holds both")
    if not is_file:
        raise ImportFailed(f"{path}: its source {name!r} is not there")
    with source.open("rb") as file:
        head = file.read(HEAD_BYTES)
    if is_virtual_raster(head):
        _check(source, root, depth + 1)
    elif find_raster_format(head) is None:
        drivers = ", ".join(sorted(format.driver for format in RASTER_FORMATS))
        raise ImportFailed(f"{path}: its source {name!r} is not a raster that map3d reads; map3d reads {drivers}")
