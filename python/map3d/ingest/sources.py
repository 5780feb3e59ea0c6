"""Which files an import is asked for, what their assets are called, and whether they changed."""

import hashlib
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from map3d.errors import NotFound, UnknownFormat
from map3d.ingest.formats import KNOWN, Format, detect_format
from map3d.ingest.referenced_files import named_files

_PASSED_OVER = (".mtl", ".jpg", ".jpeg", ".png", ".bmp", ".gif", ".tga", ".txt", ".md", ".json", ".pdf", ".html", ".prj", ".tfw", ".xsd", ".sqlite")
_PROMISING = (".gml", ".citygml", ".obj", ".tif", ".tiff")
"""A file of such a name is meant to be read; one that cannot be is worth a word."""

Refuse = Callable[[Path, str], None]
"""Called with a file of a folder that will not be read, and why."""


@dataclass(frozen=True)
class Source:
    """`paths`: the document; for terrain its rasters."""

    name: str
    format: Format
    paths: tuple[Path, ...]


def find_sources(paths: Iterable[Path], name: str | None = None, refuse: Refuse | None = None) -> list[Source]:
    """Files as named; of folders every file of a known format, however deep, in order of their names. Rasters are one terrain for each folder.

    `refuse` hears of files in folders whose names promise what their content is not.

    Raises UnknownFormat for a named file of unknown type and for a folder that has nothing to read; NotFound.
    """
    found: list[tuple[Path, Format]] = []
    for path in paths:
        if path.is_dir():
            found += _in_folder(path, refuse or (lambda *_: None))
        elif path.exists():
            found.append((path, detect_format(path)))
        else:
            raise NotFound(f"{path}: no such file or folder")
    return _named(_grouped(found), name)


def source_digest(source: Source) -> str:
    """Over the document's bytes, the files beside it whose names begin with its stem, and the libraries and images that it names."""
    total = hashlib.sha256()
    for path in source.paths:
        for part in [path, *_companions(path)]:
            total.update(part.name.encode())
            with part.open("rb") as file:
                total.update(hashlib.file_digest(file, "sha256").digest())
    return total.hexdigest()[:32]


def _in_folder(folder: Path, refuse: Refuse) -> list[tuple[Path, Format]]:
    found, unknown = [], []
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(".")):
        if path.suffix.lower() in _PASSED_OVER:
            continue
        try:
            found.append((path, detect_format(path)))
        except UnknownFormat as error:
            unknown.append((path, str(error)))
    if not found:
        why = f" ({unknown[0][1].partition(';')[0]})" if unknown else ""
        raise UnknownFormat(f"{folder}: no file in it that map3d can read{why}; it reads {KNOWN}")
    for path, text in unknown:
        if path.suffix.lower() in _PROMISING:
            refuse(path, text)
    return found


def _grouped(found: Sequence[tuple[Path, Format]]) -> list[tuple[Format, tuple[Path, ...]]]:
    rasters: dict[Path, list[Path]] = {}
    groups: list[tuple[Format, tuple[Path, ...]]] = []
    for path, format in found:
        if format == "raster":
            rasters.setdefault(path.parent, []).append(path)
        else:
            groups.append((format, (path,)))
    return groups + [("raster", tuple(paths)) for paths in rasters.values()]


def _named(groups: Sequence[tuple[Format, tuple[Path, ...]]], name: str | None) -> list[Source]:
    """Names from the files', numbered where two would be the same."""
    taken: set[str] = set()
    sources = []
    for format, paths in groups:
        wanted = asset_name(name or (paths[0].stem if format != "raster" or len(paths) == 1 else paths[0].parent.name))
        unique, number = wanted, 2
        while unique in taken:
            unique, number = f"{wanted[:58]}-{number}", number + 1
        taken.add(unique)
        sources.append(Source(unique, format, paths))
    return sources


def asset_name(text: str) -> str:
    """The text as a name: lower case, other characters become dashes."""
    plain = re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-_")
    return plain[:64] or "asset"


def _companions(path: Path) -> list[Path]:
    beside = {other.resolve() for other in path.parent.glob(f"{_escaped(path.stem)}.*") if other.is_file()}
    return sorted((beside | named_files(path)) - {path.resolve()})


def _escaped(stem: str) -> str:
    return re.sub(r"([\[\]*?])", r"[\1]", stem)
