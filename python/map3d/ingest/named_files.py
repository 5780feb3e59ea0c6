"""Which files a document names: material libraries, images, library objects. For noticing changes only: what is read of them, the core decides."""

import mmap
import re
from collections.abc import Iterator, Sequence
from html import unescape
from pathlib import Path
from typing import Final
from urllib.parse import unquote

# Each part is bounded or excludes what follows it, so that hostile files cost no more than their length.
_IN_XML: Final = re.compile(rb"(?:imageURI|libraryObject)>([^<>]{1,4096})<")
_IN_OBJ: Final = re.compile(rb"^mtllib[ \t]([^\r\n]{1,4096})", re.MULTILINE)
_IN_MTL: Final = re.compile(rb"^[ \t]{0,64}(?:map_\w{1,16}|bump|disp|decal|norm|refl)[ \t]([^\r\n]{1,4096})", re.MULTILINE | re.IGNORECASE)


def named_files(path: Path) -> set[Path]:
    """Those that are there, inside the document's folder."""
    folder = path.parent.resolve()
    if path.suffix.lower() != ".obj":
        return set(_found(path, _IN_XML, [folder]))
    libraries = set(_found(path, _IN_OBJ, [folder]))
    return libraries | {image for library in libraries for image in _found(library, _IN_MTL, [library.parent, folder])}


def _found(path: Path, pattern: re.Pattern[bytes], folders: Sequence[Path]) -> Iterator[Path]:
    with path.open("rb") as file:
        if path.stat().st_size == 0:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            names = {match[1].strip() for match in pattern.finditer(text)}
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
