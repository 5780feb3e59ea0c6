"""Finds the files that a document references: material libraries, images, library objects.

The result only detects changes. The core decides which of these files it reads.
"""

import mmap
import re
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from pathlib import Path
from typing import Final
from urllib.parse import unquote

# Every pattern is bounded or excludes what follows it, so that a hostile file costs no more than its length.
_CITYGML_TAGS: Final = (b"imageURI>", b"libraryObject>")
_MAX_NAME_BYTES: Final = 4096
_OBJ_LIBRARY: Final = re.compile(rb"^mtllib[ \t]([^\r\n]{1,4096})", re.MULTILINE)
_MTL_IMAGE: Final = re.compile(rb"^[ \t]{0,64}(?:map_\w{1,16}|bump|disp|decal|norm|refl)[ \t]([^\r\n]{1,4096})", re.MULTILINE | re.IGNORECASE)


def find_referenced_files(path: Path) -> set[Path]:
    """Returns the referenced files that exist inside the document's folder."""
    folder = path.parent.resolve()
    if path.suffix.lower() != ".obj":
        return set(_existing_files(path, _find_elements, [folder]))
    libraries = set(_existing_files(path, _match(_OBJ_LIBRARY), [folder]))
    return libraries | {image for library in libraries for image in _existing_files(library, _match(_MTL_IMAGE), [library.parent, folder])}


def _match(pattern: re.Pattern[bytes]) -> Callable[[mmap.mmap], Iterator[bytes]]:
    return lambda text: (match[1] for match in pattern.finditer(text))


def _find_elements(text: mmap.mmap) -> Iterator[bytes]:
    """Yields the content of the elements that contain file names. It uses plain search, because city models are large and such elements rare."""
    for tag in _CITYGML_TAGS:
        at = text.find(tag)
        while at >= 0:
            start = at + len(tag)
            end = text.find(b"<", start, start + _MAX_NAME_BYTES + 1)
            if end > start and b">" not in (name := text[start:end]):
                yield name
            at = text.find(tag, start)


def _existing_files(path: Path, find_names: Callable[[mmap.mmap], Iterator[bytes]], folders: Sequence[Path]) -> Iterator[Path]:
    with path.open("rb") as file:
        if path.stat().st_size == 0:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            names = {name.strip() for name in find_names(text)}
    for name in names:
        for folder in folders:
            yield from _resolve(folder, name.decode("utf-8", "replace"))


def _resolve(folder: Path, text: str) -> Iterator[Path]:
    """Tries the name as written, URL-decoded, and word by word (the first words of an MTL statement may be options)."""
    plain = unescape(text).replace("\\", "/")
    for name in {plain, unquote(plain), *plain.split(maxsplit=16)}:
        try:
            path = (folder / name).resolve()
            if path.is_relative_to(folder) and path.is_file():
                yield path
        except (OSError, ValueError):
            continue
