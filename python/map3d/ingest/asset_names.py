"""Names of assets: made of the names of their files, and kept when other files are added, removed or moved."""

import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, islice, takewhile
from pathlib import Path
from typing import Final

from map3d.formats.gzip_file import unpacked_path
from map3d.formats.source_format import SourceFormat

_MAX_NAME_CHARS: Final = 64
_REMOVED_PARTS: Final = 2
"""Equal parts of two paths, from the end, for which a file is the one of a removed asset: its name and that of its folder."""


@dataclass(frozen=True)
class FileGroup:
    """Files of one source. `label`: the text from which its name is made; `places`: the paths as the user knows them, which lead through archives;
    `root`: the given folder, None for a file that was given itself. The others are those of SourceDocument."""

    label: str
    format: SourceFormat
    paths: tuple[Path, ...]
    places: tuple[Path, ...]
    root: Path | None = None
    virtual: bool = False
    appearances: tuple[Path, ...] = ()


class AssetNames:
    """The names that assets have, and those that removed ones had."""

    def __init__(self, known: Mapping[str, Path], taken: Collection[str], removed: Mapping[str, Path]) -> None:
        """`known`: the files of assets by name; `taken`: known names that only these files have; `removed`: the files of removed assets by name."""
        self.known = known
        self.removed = {name: path for name, path in removed.items() if name not in known}
        self._taken = frozenset(taken)
        self._names: dict[tuple[int, int], set[str]] = {}
        for name in self._taken:
            self._names.setdefault(_identity(known[name]), set()).add(name)

    def of_others(self, group: FileGroup) -> frozenset[str]:
        """Returns the taken names of files that are not the group's."""
        own = {name for path in group.paths for name in self._names.get(_identity(path), ())} if self._names else set()
        return self._taken - own if own else self._taken

    def of_absent(self, groups: Sequence[FileGroup]) -> frozenset[str]:
        """Returns the taken names of files that no group has."""
        return self._taken - {name for group in groups for path in group.paths for name in self._names.get(_identity(path), ())}


def _identity(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino


def name_groups(groups: Sequence[FileGroup], name: str | None, names: AssetNames) -> list[str]:
    """Names groups after their files and numbers duplicates, without changing the names of known ones."""
    wanted = [asset_name(name or group.label) for group in groups]
    kept = {} if name else _kept_names(groups, wanted, names)
    used = set(kept.values())
    absent = names.of_absent(groups)
    found = []
    for position, group in enumerate(groups):
        possible = _possible_names(group, wanted[position], with_folders=_is_given(group) or wanted[position] in absent)
        unique = kept.get(position) or next(_free(possible, wanted[position], used, group, None if name else names))
        used.add(unique)
        found.append(unique)
    return found


def _free(possible: Iterator[str], wanted: str, used: Collection[str], group: FileGroup, names: AssetNames | None) -> Iterator[str]:
    """Yields the names that no other file has. A removed asset keeps a longer name than the wanted one for its file."""
    others = names.of_others(group) if names else frozenset()
    removed = names.removed if names else {}
    return (text for text in possible if text not in used and text not in others and (text == wanted or text not in removed))


def _is_given(group: FileGroup) -> bool:
    """Returns whether the group is a document that was given itself."""
    return group.root is None and not group.format.is_grouped


def _possible_names(group: FileGroup, wanted: str, *, with_folders: bool) -> Iterator[str]:
    """Yields the name; `with_folders`: also with the names of its folders, the nearest first; then with numbers from 2 on."""
    yield wanted
    if with_folders:
        words = [asset_name(part) for part in reversed(_folder_of(group).parts[1:])]
        longer = ["-".join([*reversed(words[:depth]), wanted]) for depth in range(1, len(words) + 1)]
        yield from (text for text in longer if len(text) <= _MAX_NAME_CHARS)
    yield from islice(_numbered(wanted), 1, None)


def _folder_of(group: FileGroup) -> Path:
    """Returns the folder that holds the file or, of rasters that are named after their folder, that folder."""
    folder = group.places[0].absolute().parent
    if group.label == group.places[0].stem or not group.format.is_grouped:
        return folder
    return Path(os.path.commonpath([path.absolute().parent for path in group.places])).parent


def _kept_names(groups: Sequence[FileGroup], wanted: Sequence[str], names: AssetNames) -> dict[int, str]:
    """Returns position → known name. A terrain has the name of its raster. Where several documents may have
    a name, the one whose path agrees with the known one in more parts from the end has it, also after their folder was moved. A removed name goes to
    a file in a folder of the same name."""
    removed = names.removed
    places: dict[str, list[tuple[str, Path]]] = {}
    for known_name, path in {**removed, **names.known}.items():
        places.setdefault(asset_name(unpacked_path(path).stem), []).append((known_name, path))
    pairs = [
        (-equal, known_name in removed, position, known_name)
        for position, group in enumerate(groups)
        for known_name, path in places.get(wanted[position], ())
        if known_name == wanted[position] or known_name.startswith(f"{wanted[position][:58]}-") or known_name.endswith(f"-{wanted[position]}")
        if known_name not in names.of_others(group)
        if (equal := _equal_parts(group.places[0], path)) >= (_REMOVED_PARTS if known_name in removed else 1)
    ]
    rasters = {path.absolute(): position for position, group in enumerate(groups) if group.format.is_grouped for path in group.places}
    pairs += [(-len(path.parts), False, rasters[path], known_name) for known_name, path in names.known.items() if path in rasters]
    kept: dict[int, str] = {}
    for _, _, position, known_name in sorted(pairs):
        if position not in kept and known_name not in kept.values():
            kept[position] = known_name
    return kept


def _equal_parts(one: Path, other: Path) -> int:
    """Returns the number of equal parts of two paths, counted from the end."""
    pairs = zip(reversed(one.absolute().parts), reversed(other.absolute().parts), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))


def _numbered(name: str) -> Iterator[str]:
    """Yields the name, and the name with numbers from 2 on."""
    yield name
    yield from (f"{name[:58]}-{number}" for number in count(2))


def asset_name(text: str) -> str:
    """Converts text to a valid name: lower case, any other character becomes a dash."""
    plain = re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-_")
    return plain[:_MAX_NAME_CHARS] or "asset"
