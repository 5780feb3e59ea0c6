"""Files of a folder that are there twice: links, copies, packed twins, and the backups that editors leave. One of them is read.

Equal bytes are the evidence. A backup, which is an earlier state, is told by its name; it counts only where the file that it names can be read.
"""

import hashlib
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from map3d.formats.gzip_file import content_bytes, content_parts, is_gzip, unpacked_path
from map3d.formats.source_format import SourceFormat
from map3d.messages import Message, message

_END_BYTES: Final = 1 << 14
_BACKUPS: Final = (
    re.compile(r"(?P<name>.+?)(?:\.~\d+~|~\d*)"),
    re.compile(r"(?P<name>.+)\.(?:bak|backup|orig|old|sav|save|rej|tmp)\d*", re.IGNORECASE),
    re.compile(r"#(?P<name>.+)#"),
)
"""Names of the backups of emacs, vi, nano, patch and others, made of the whole name of the file."""
_COPY_WORDS: Final = r"(?:(?:another |\d+(?:st|nd|rd|th) )?copy|(?:weitere |\d+\. )?Kopie|(?:autre )?copie|c[oó]pia)"
_COPIES: Final = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r".+?\s?\(\d{1,3}\)",
        rf".+?\s?\({_COPY_WORDS}(?: \d+)?\)",
        rf".+?(?: - |[ _-]){_COPY_WORDS}(?: ?\(?\d+\)?)?",
        r"(?:copy(?: \(?\d+\)?)? of|Kopie(?: \(?\d+\)?)? von|copie(?: \(?\d+\)?)? de|c[oó]pia(?: \(?\d+\)?)? d[ei]) .+",
        r".+[ ._-](?:bak|backup|orig|old|alt|sav|save|sicherung)\d*",
    )
)
"""Names, without suffixes, that browsers, desktops and people give to copies."""

Found = tuple[Path, SourceFormat]
Copies = Mapping[Path, Message]
"""The files that are not read, and what they are."""


def backed_up(name: str) -> str | None:
    """Returns the name of the file of which an editor made this backup; None if it is none by its name."""
    found = (match["name"] for pattern in _BACKUPS if (match := pattern.fullmatch(name)))
    return next(found, None)


def is_copy_name(name: str) -> bool:
    """Whether the name of a file says that it is a copy."""
    stem = unpacked_path(Path(name)).stem
    return any(pattern.fullmatch(stem) for pattern in _COPIES)


def find_backups(paths: Sequence[Path], readable: Iterable[Path], shown: Callable[[Path], str]) -> Copies:
    """Returns the backups among the files of a folder: those whose original is there and, if they are documents, is one of the `readable`. `shown`:
    how messages name a file."""
    there, good = set(paths), set(readable)
    backups = {}
    for path in paths:
        name = backed_up(path.name)
        original = None if name is None else path.with_name(name)
        if original in there and (original in good or path not in good):
            backups[path] = message("left-backup", of=shown(original))
    return backups


def find_copies(found: Sequence[Found], roles: Callable[[Path], tuple[bool, bool]], shown: Callable[[Path], str]) -> Copies:
    """Returns the files that have the content and the place of another: links and copies. Of several, the one counts that others use, is no link, has
    no copy's name, is not packed, is known (the file of an asset), names the fewest missing files, and lies highest.

    `roles`: whether others use a file, and whether it is known; `shown`: how messages name a file. Raises OSError.
    """
    copies: dict[Path, Message] = {}
    for files in _equal_files(found):
        kept, *others = sorted(files, key=lambda file: _preference(file, roles))
        for path, _ in others:
            is_link = path.is_symlink() or path.samefile(kept[0])
            copies[path] = message("left-link" if is_link else "left-same-content", of=shown(kept[0]))
    return copies


def _preference(file: Found, roles: Callable[[Path], tuple[bool, bool]]) -> tuple[object, ...]:
    path, format = file
    is_named_so = is_copy_name(path.name) or backed_up(path.name) is not None
    missing = len(format.find_missing(path, None).names) if format.names_files else 0
    is_used, is_known = roles(path)
    return not is_used, path.is_symlink(), is_named_so, is_gzip(path), not is_known, missing, len(path.parts), str(path)


def _equal_files(found: Sequence[Found]) -> Iterator[list[Found]]:
    """Yields the files of equal content, two or more at a time. Files are read only as far as needed to tell them apart."""
    for group in _split(found, lambda file: (file[1].name, file[0].stat().st_size)):
        for near in _split(group, lambda file: _digest_of_ends(file[0])):
            yield from _split(near, lambda file: (_digest(file[0]), _place_digest(*file)))
    packed = [file for file in found if is_gzip(file[0])]
    plain = dict(found)
    for path, format in packed:
        twin = unpacked_path(path)
        if twin != path and twin in plain and content_bytes(path) == twin.stat().st_size and _content_digest(path) == _digest(twin):
            yield [(path, format), (twin, plain[twin])]


def _split(files: Sequence[Found], key: Callable[[Found], object]) -> Iterator[list[Found]]:
    """Yields the groups of files with an equal key, without those that have one alone."""
    groups: dict[object, list[Found]] = {}
    for file in files:
        groups.setdefault(key(file), []).append(file)
    yield from (group for group in groups.values() if len(group) > 1)


def _digest_of_ends(path: Path) -> bytes:
    with path.open("rb") as file:
        first = file.read(_END_BYTES)
        file.seek(max(0, os.fstat(file.fileno()).st_size - _END_BYTES))
        return hashlib.sha256(first + file.read(_END_BYTES)).digest()


def _digest(path: Path) -> bytes:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").digest()


def _content_digest(path: Path) -> bytes:
    total = hashlib.sha256()
    for part in content_parts(path):
        total.update(part)
    return total.digest()


def _place_digest(path: Path, format: SourceFormat) -> bytes:
    """Returns the digest of the files that say where a file lies: equal images with other world files are no copies."""
    total = hashlib.sha256()
    for place in sorted(format.find_places(path), key=lambda file: file.suffix):
        total.update(place.suffix.lower().encode() + _digest(place))
    return total.digest()
