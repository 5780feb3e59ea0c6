"""Finds the source documents of an import, names their assets, and detects whether they changed."""

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from map3d.errors import NotFound, UnknownFormat
from map3d.ingest.formats import READABLE_FORMATS, Format, detect_format
from map3d.ingest.referenced_files import find_referenced_files

_COMPANION_SUFFIXES = (
    ".mtl", ".jpg", ".jpeg", ".png", ".bmp", ".gif", ".tga", ".txt", ".md", ".json", ".pdf", ".html", ".prj", ".tfw", ".xsd", ".sqlite",
)  # fmt: skip
_SOURCE_SUFFIXES = (".gml", ".citygml", ".obj", ".tif", ".tiff")
"""Files with these suffixes are reported if they are unreadable."""

OnUnreadable = Callable[[Path, str], None]
"""Called with an unreadable file of a folder and the reason."""


@dataclass(frozen=True)
class SourceDocument:
    """`paths`: the document; for terrain, its rasters."""

    name: str
    format: Format
    paths: tuple[Path, ...]


def find_sources(paths: Iterable[Path], name: str | None = None, on_unreadable: OnUnreadable | None = None) -> list[SourceDocument]:
    """Returns the given files, and every file of a known format below the given folders, sorted by path. The rasters of a folder are one source.

    `on_unreadable` is called for files in folders whose suffix announces a known format that their content is not.

    Raises UnknownFormat for a given file of unknown format and for a folder without any readable file; NotFound.
    """
    found: list[tuple[Path, Format]] = []
    for path in paths:
        if path.is_dir():
            found += _search_folder(path, on_unreadable or (lambda *_: None))
        elif path.exists():
            found.append((path, detect_format(path)))
        else:
            raise NotFound(f"{path}: no such file or folder")
    return _name_sources(_group_rasters(found), name)


def source_digest(source: SourceDocument) -> str:
    """Computes the digest of the document, the files beside it whose names begin with its stem, and the libraries and images that it references."""
    total = hashlib.sha256()
    for path in source.paths:
        for part in [path, *_find_companions(path)]:
            total.update(part.name.encode())
            with part.open("rb") as file:
                total.update(hashlib.file_digest(file, "sha256").digest())
    return total.hexdigest()[:32]


def _search_folder(folder: Path, on_unreadable: OnUnreadable) -> list[tuple[Path, Format]]:
    found, unknown = [], []
    for path in sorted(path for path in _walk(folder) if path.is_file() and not path.name.startswith(".")):
        if path.suffix.lower() in _COMPANION_SUFFIXES:
            continue
        try:
            found.append((path, detect_format(path)))
        except UnknownFormat as error:
            unknown.append((path, str(error)))
    if not found:
        example = f" (found {unknown[0][1].partition(';')[0]})" if unknown else ""
        raise UnknownFormat(f"{folder}: no readable file in this folder{example}; map3d reads {READABLE_FORMATS}")
    for path, reason in unknown:
        if path.suffix.lower() in _SOURCE_SUFFIXES:
            on_unreadable(path, reason)
    return found


def _walk(folder: Path) -> Iterator[Path]:
    """Yields the files below a folder. Raises NotFound for a folder that cannot be read: its files must not seem to be gone."""

    def refuse(error: OSError) -> None:
        raise NotFound(f"{error.filename}: cannot read the folder: {error.strerror}") from error

    for place, _, names in os.walk(folder, onerror=refuse):
        yield from (Path(place, name) for name in names)


def _group_rasters(found: Sequence[tuple[Path, Format]]) -> list[tuple[Format, tuple[Path, ...]]]:
    rasters: dict[Path, list[Path]] = {}
    groups: list[tuple[Format, tuple[Path, ...]]] = []
    for path, format in found:
        if format == "raster":
            rasters.setdefault(path.parent, []).append(path)
        else:
            groups.append((format, (path,)))
    return groups + [("raster", tuple(paths)) for paths in rasters.values()]


def _name_sources(groups: Sequence[tuple[Format, tuple[Path, ...]]], name: str | None) -> list[SourceDocument]:
    """Names sources after their files and numbers duplicates."""
    taken: set[str] = set()
    sources = []
    for format, paths in groups:
        wanted = asset_name(name or (paths[0].stem if format != "raster" or len(paths) == 1 else paths[0].parent.name))
        unique, number = wanted, 2
        while unique in taken:
            unique, number = f"{wanted[:58]}-{number}", number + 1
        taken.add(unique)
        sources.append(SourceDocument(unique, format, paths))
    return sources


def asset_name(text: str) -> str:
    """Converts text to a valid name: lower case, any other character becomes a dash."""
    plain = re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-_")
    return plain[:64] or "asset"


def _find_companions(path: Path) -> list[Path]:
    beside = {other.resolve() for other in path.parent.glob(f"{_escape_glob(path.stem)}.*") if other.is_file()}
    return sorted((beside | find_referenced_files(path)) - {path.resolve()})


def _escape_glob(stem: str) -> str:
    return re.sub(r"([\[\]*?])", r"[\1]", stem)
