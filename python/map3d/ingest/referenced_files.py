"""Finds the files that a document references: material libraries, images, library objects, code lists.

The result only detects changes. The core decides which of these files it reads.
"""

import mmap
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Final, Self
from urllib.parse import unquote

from map3d.ingest.gzip_file import content_windows, is_gzip, unpacked_path

# Every pattern is bounded or excludes what follows it, so that a hostile file costs no more than its length.
_CITYGML_TAGS: Final = (b"imageURI>", b"textureMap>", b"libraryObject>", b"fileName>", b"fileReference>")
_IMAGE_TAGS: Final = _CITYGML_TAGS[:2]
_MAX_NAME_BYTES: Final = 4096
_CODE_LIST: Final = re.compile(rb"""codeSpace=["']([^"'<>]{1,4096}\.(?:xml|gml))["']""", re.IGNORECASE)
_OBJ_LIBRARY: Final = re.compile(rb"^mtllib[ \t]([^\r\n]{1,4096})", re.MULTILINE)
_MTL_IMAGE: Final = re.compile(rb"^[ \t]{0,64}(?:map_\w{1,16}|bump|disp|decal|norm|refl)[ \t]([^\r\n]{1,4096})", re.MULTILINE | re.IGNORECASE)

FindNames = Callable[[mmap.mmap | bytes], Iterator[bytes]]
"""Finds file names in the text of a document."""


def find_referenced_files(path: Path, root: Path | None = None) -> set[Path]:
    """Returns the referenced files that exist inside `root`, by default the document's folder."""
    folder = FileNames.of(path, root)
    if unpacked_path(path).suffix.lower() != ".obj":
        return set(_existing_files(path, _find_elements, [folder])) | find_code_lists(path, root)
    libraries = set(_existing_files(path, _match(_OBJ_LIBRARY), [folder]))
    return libraries | {image for library in libraries for image in _existing_files(library, _match(_MTL_IMAGE), [folder.beside(library), folder])}


def find_code_lists(path: Path, root: Path | None = None) -> set[Path]:
    """Returns the dictionaries of codes that a CityGML document names and that exist inside `root`, by default the document's folder."""
    return set(_existing_files(path, _match(_CODE_LIST), [FileNames.of(path, root)]))


@dataclass(frozen=True)
class MissingFiles:
    """`names`: of referenced files that are not there, sorted. `images`: number of the images referenced, `missing_images`: of those not there."""

    names: list[str]
    images: int
    missing_images: int


def find_missing_files(path: Path, root: Path | None = None) -> MissingFiles:
    """Finds the referenced files that are not inside `root`, by default the document's folder; references to the web are not files."""
    folder = FileNames.of(path, root)
    if unpacked_path(path).suffix.lower() != ".obj":
        images, missing_images = _names(path, _find_images), _missing(path, _find_images, [folder])
        return MissingFiles(sorted(_missing(path, _find_elements, [folder])), len(images), len(missing_images))
    libraries = set(_existing_files(path, _match(_OBJ_LIBRARY), [folder]))
    images, missing_images = set(), set()
    for library in libraries:
        images |= _names(library, _match(_MTL_IMAGE))
        missing_images |= _missing(library, _match(_MTL_IMAGE), [folder.beside(library), folder])
    return MissingFiles(sorted(_missing(path, _match(_OBJ_LIBRARY), [folder]) | missing_images), len(images), len(missing_images))


@dataclass(frozen=True)
class FileNames:
    """Resolves names of files. `base`: the folder to which they are relative; `root`: that in which the files must be; both without links."""

    base: Path
    root: Path

    @classmethod
    def of(cls, document: Path, root: Path | None) -> Self:
        base = document.parent.resolve()
        return cls(base, base if root is None else root.resolve())

    def beside(self, file: Path) -> "FileNames":
        return FileNames(file.parent, self.root)

    def find(self, text: str) -> Iterator[Path]:
        """Tries the name as written, URL-decoded, and word by word (the first words of an MTL statement may be options)."""
        plain = unescape(text).replace("\\", "/")
        for name in {plain, unquote(plain), *plain.split(maxsplit=16)}:
            try:
                path = (self.base / name).resolve()
                if path.is_relative_to(self.root) and path.is_file():
                    yield path
            except (OSError, ValueError):
                continue


def _find_names(path: Path, find_names: FindNames) -> set[bytes]:
    if is_gzip(path):
        return {name.strip() for text in content_windows(path, 2 * _MAX_NAME_BYTES) for name in find_names(text)}
    if path.stat().st_size == 0:
        return set()
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        return {name.strip() for name in find_names(text)}


def _names(path: Path, find_names: FindNames) -> set[str]:
    names = {name.decode("utf-8", "replace") for name in _find_names(path, find_names)}
    return {name for name in names if name and "://" not in name}


def _missing(path: Path, find_names: FindNames, folders: Sequence[FileNames]) -> set[str]:
    return {name for name in _names(path, find_names) if not any(found for folder in folders for found in folder.find(name))}


def _match(pattern: re.Pattern[bytes]) -> FindNames:
    return lambda text: (match[1] for match in pattern.finditer(text))


def _find_images(text: mmap.mmap | bytes) -> Iterator[bytes]:
    return _find_elements(text, _IMAGE_TAGS)


def _find_elements(text: mmap.mmap | bytes, tags: Sequence[bytes] = _CITYGML_TAGS) -> Iterator[bytes]:
    """Yields the content of the elements that contain file names. It uses plain search, because city models are large and such elements rare."""
    for tag in tags:
        at = text.find(tag)
        while at >= 0:
            start = at + len(tag)
            end = text.find(b"<", start, start + _MAX_NAME_BYTES + 1)
            if end > start and b">" not in (name := text[start:end]):
                yield name
            at = text.find(tag, start)


def _existing_files(path: Path, find_names: FindNames, folders: Sequence[FileNames]) -> Iterator[Path]:
    for name in _find_names(path, find_names):
        for folder in folders:
            yield from folder.find(name.decode("utf-8", "replace"))
