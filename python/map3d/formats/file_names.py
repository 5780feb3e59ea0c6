"""Finds the files that a document names.

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

from map3d.formats.gzip_file import content_windows, is_gzip

MAX_NAME_BYTES: Final = 4096

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
        return {name.strip() for text in content_windows(path, 2 * MAX_NAME_BYTES) for name in find_names(text)}
    if path.stat().st_size == 0:
        return set()
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        return {name.strip() for name in find_names(text)}


def names_in(path: Path, find_names: FindNames) -> set[str]:
    names = {name.decode("utf-8", "replace") for name in _find_names(path, find_names)}
    return {name for name in names if name and "://" not in name}


def missing(path: Path, find_names: FindNames, folders: Sequence[FileNames]) -> set[str]:
    return {name for name in names_in(path, find_names) if not any(found for folder in folders for found in folder.find(name))}


def match(pattern: re.Pattern[bytes]) -> FindNames:
    return lambda text: (match[1] for match in pattern.finditer(text))


def existing_files(path: Path, find_names: FindNames, folders: Sequence[FileNames]) -> Iterator[Path]:
    for name in _find_names(path, find_names):
        for folder in folders:
            yield from folder.find(name.decode("utf-8", "replace"))
