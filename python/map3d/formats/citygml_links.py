"""Finds which CityGML files refer to which others: to their geometry, or to surfaces of theirs that an appearance targets.

The result says which files an import reads and depends on. The core decides what it reads of them.
"""

import mmap
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from map3d.formats.file_names import FileNames, text_windows, xml_name
from map3d.formats.source_format import DocumentLinks

MAX_CHAIN: Final = 16
"""Longest chain of references that the reader follows."""
_MAX_NAME_BYTES: Final = 4096
_SUFFIXES: Final = (b"ml#", b"ML#", b".gz#", b".GZ#")
"""Ends of the names of other documents, with the sign before the id: .gml, .xml, .citygml."""
_DELIMITERS: Final = (b'"', b"'", b">")
_OBJECT_MEMBERS: Final = (b"bjectMember", b"eatureMember", b":member>", b"<member>")


def find_document_links(path: Path, root: Path | None = None) -> DocumentLinks:
    """Returns the existing files inside `root`, by default the document's folder, that the document refers to."""
    status = path.stat()
    found = _read_names(path.resolve(), status.st_mtime_ns, status.st_size)
    names, itself = FileNames.of(path, root), path.resolve()
    return DocumentLinks(_resolve(names, found.geometry, itself), _resolve(names, found.targets, itself), found.has_objects)


def find_geometry_documents(path: Path, root: Path | None = None) -> set[Path]:
    """Returns the documents whose geometry a document draws, also by way of others."""
    root = root or path.parent
    found: set[Path] = set()
    ring = {path.resolve()}
    for _ in range(MAX_CHAIN):
        ring = {linked for document in ring for linked in find_document_links(document, root).geometry} - found
        found |= ring
    return found - {path.resolve()}


@dataclass(frozen=True)
class _NamesInDocument:
    """The names of other documents as written, whether they exist or not."""

    geometry: frozenset[bytes]
    targets: frozenset[bytes]
    has_objects: bool


@lru_cache(maxsize=65536)
def _read_names(path: Path, _mtime_ns: int, _size: int) -> _NamesInDocument:
    geometry, targets, has_objects = set[bytes](), set[bytes](), False
    for text in text_windows(path, 2 * _MAX_NAME_BYTES):
        has_objects = has_objects or any(text.find(word) >= 0 for word in _OBJECT_MEMBERS)
        for name, is_href in _find_names(text):
            (geometry if is_href else targets).add(name)
    return _NamesInDocument(frozenset(geometry), frozenset(targets), has_objects)


def _resolve(names: FileNames, found: frozenset[bytes], document: Path) -> frozenset[Path]:
    paths = (names.find(xml_name(name)) for name in found)
    return frozenset(path for path in paths if path is not None and path != document)


def _find_names(text: mmap.mmap | bytes) -> Iterator[tuple[bytes, bool]]:
    """Yields the names of documents, and whether each is in an XLink. It uses plain search, because such names are rare."""
    for suffix in _SUFFIXES:
        at = text.find(suffix)
        while at >= 0:
            end = at + len(suffix) - 1
            before = text[max(0, end - _MAX_NAME_BYTES) : end]
            start = max(before.rfind(delimiter) for delimiter in _DELIMITERS) + 1
            name = before[start:].strip()
            if start and name and b"://" not in name:
                yield name, before[: start - 1].rstrip().endswith((b"href=", b"href ="))
            at = text.find(suffix, end)
