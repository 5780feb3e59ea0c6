"""Finds the files that a document names.

The result detects changes and names what is missing. The core decides which of these files it reads; it resolves the names here, too.
"""

import codecs
import mmap
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from html import unescape
from pathlib import Path
from typing import IO, Final, Self

from map3d import _core
from map3d.formats.gzip_file import content_windows, is_gzip

MAX_NAME_BYTES: Final = 4096
_WINDOW_CHARS: Final = 1 << 20

FindNames = Callable[[mmap.mmap | bytes], Iterator[bytes]]
"""Finds file names in the text of a document."""


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

    @cached_property
    def finder(self) -> _core.FileFinder:
        return _core.FileFinder(str(self.base), str(self.root))

    def find(self, name: str) -> Path | None:
        return self.finder.find(name)[0]

    def is_file_name(self, name: str) -> bool:
        """Whether a name is that of a file, not a URL."""
        return self.finder.find(name)[1]


def text_windows(path: Path, overlap: int) -> Iterator[mmap.mmap | bytes]:
    """Yields the text of a document, of a packed one in pieces. Each repeats at least `overlap` bytes of the one before. UTF-16 becomes UTF-8."""
    if is_gzip(path):
        yield from content_windows(path, overlap)
        return
    if path.stat().st_size == 0:
        return
    with path.open("rb") as file:
        encoding = _core.utf16_encoding(file.read(_core.HEAD_BYTES))
        if encoding is not None:
            yield from _decoded_windows(file, encoding, overlap)
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            yield text


def _decoded_windows(file: IO[bytes], encoding: str, overlap: int) -> Iterator[bytes]:
    file.seek(0)
    text, repeated = codecs.getreader(encoding)(file, "replace"), ""
    while part := text.read(_WINDOW_CHARS):
        repeated += part
        yield repeated.encode()
        repeated = repeated[-overlap:]


def find_texts(path: Path, find: FindNames) -> set[bytes]:
    """Returns what `find` finds in a document, stripped."""
    found = {text.strip() for window in text_windows(path, 2 * MAX_NAME_BYTES) for text in find(window)}
    return found - {b""}


def xml_name(text: bytes) -> str:
    """Returns a file name in XML, without entities."""
    try:
        return unescape(text.decode())
    except UnicodeDecodeError:
        return unescape(text.decode("cp1252", "replace"))


def match(pattern: re.Pattern[bytes]) -> FindNames:
    return lambda text: (match[1] for match in pattern.finditer(text))
