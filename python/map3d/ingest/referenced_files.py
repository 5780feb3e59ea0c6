"""Which files a document names: material libraries, images, library objects. For noticing changes only: what is read of them, the core decides."""

import mmap
import re
from collections.abc import Callable, Iterator, Sequence
from html import unescape
from pathlib import Path
from typing import Final
from urllib.parse import unquote

# Each part is bounded or excludes what follows it, so that hostile files cost no more than their length.
_IN_XML: Final = (b"imageURI>", b"libraryObject>")
_LONGEST: Final = 4096
_IN_OBJ: Final = re.compile(rb"^mtllib[ \t]([^\r\n]{1,4096})", re.MULTILINE)
_IN_MTL: Final = re.compile(rb"^[ \t]{0,64}(?:map_\w{1,16}|bump|disp|decal|norm|refl)[ \t]([^\r\n]{1,4096})", re.MULTILINE | re.IGNORECASE)


def named_files(path: Path) -> set[Path]:
    """Those that are there, inside the document's folder."""
    folder = path.parent.resolve()
    if path.suffix.lower() != ".obj":
        return set(_found(path, _elements, [folder]))
    libraries = set(_found(path, _matches(_IN_OBJ), [folder]))
    return libraries | {image for library in libraries for image in _found(library, _matches(_IN_MTL), [library.parent, folder])}


def _matches(pattern: re.Pattern[bytes]) -> Callable[[mmap.mmap], Iterator[bytes]]:
    return lambda text: (match[1] for match in pattern.finditer(text))


def _elements(text: mmap.mmap) -> Iterator[bytes]:
    """What stands in the elements of those names; by plain search, since city models are large and names in them few."""
    for tag in _IN_XML:
        at = text.find(tag)
        while at >= 0:
            start = at + len(tag)
            end = text.find(b"<", start, start + _LONGEST + 1)
            if end > start and b">" not in (name := text[start:end]):
                yield name
            at = text.find(tag, start)


def _found(path: Path, names_in: Callable[[mmap.mmap], Iterator[bytes]], folders: Sequence[Path]) -> Iterator[Path]:
    with path.open("rb") as file:
        if path.stat().st_size == 0:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            names = {name.strip() for name in names_in(text)}
    for name in names:
        for folder in folders:
            yield from _inside(folder, name.decode("utf-8", "replace"))


def _inside(folder: Path, text: str) -> Iterator[Path]:
    """The name as it stands, decoded as a reference, or one of a few words, of which the first may be options."""
    plain = unescape(text).replace("\\", "/")
    for name in {plain, unquote(plain), *plain.split(maxsplit=16)}:
        try:
            path = (folder / name).resolve()
            if path.is_relative_to(folder) and path.is_file():
                yield path
        except (OSError, ValueError):
            continue
