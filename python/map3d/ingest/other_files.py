"""What is said of files of a folder without city data: those that belong to documents, those that nothing uses, and those of map3d itself."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from map3d.formats import FORMATS
from map3d.formats.source_format import SourceFormat
from map3d.messages import Message, message

_COMPANIONS: Final = {suffix for format in FORMATS for suffix in format.companions}
_OWN: Final = (("catalogue.sqlite", "scenes"), ("workspace.json",), ("rendering.json", "checksums.sha256"))
"""What the folders of map3d hold: workspaces and publications."""

Document = tuple[Path, SourceFormat, Path]
"""A document, its format, and the folder in which the files that it names may be."""


def is_written_by_map3d(folder: Path) -> bool:
    """Whether a folder is a workspace or a publication."""
    return any(all((folder / name).exists() for name in names) for names in _OWN)


def note_others(
    others: Sequence[Path], documents: Sequence[Document], noted: Iterable[Path], shown: Callable[[Path], str]
) -> Iterator[tuple[Path, Message]]:
    """Yields each of the other files, and what it is. `noted`: files of which something is said already; `shown`: how messages name a file."""
    owners = _owners(others, documents) if others else {}
    for path in sorted(noted):
        owners.setdefault(_stem(path), path)
    for path in others:
        of = owners.get(path.resolve()) or owners.get(_stem(path))
        if of is not None:
            yield path, message("used-beside", of=shown(of))
        else:
            yield path, message("not-used" if path.suffix.lower() in _COMPANIONS else "without-city-data")


def _owners(others: Sequence[Path], documents: Sequence[Document]) -> dict[Path, Path]:
    """Returns the documents of the files that they name, and of the beginnings of the names of files beside them."""
    suffixes = {path.suffix.lower() for path in others}
    owners: dict[Path, Path] = {}
    for path, format, root in documents:
        owners.setdefault(_stem(path), path)
        named = format.find_places(path)
        if suffixes.intersection(format.companions):
            named |= format.find_files(path, root)
        for file in named:
            owners.setdefault(file.resolve(), path)
    return owners


def _stem(path: Path) -> Path:
    """Returns the path of a file without all its suffixes, which files that belong together share."""
    return path.with_name(path.name.partition(".")[0])
