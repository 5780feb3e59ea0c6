"""Finds the source documents of an import, names their assets, and detects whether they changed."""

import hashlib
import json
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count, islice, takewhile
from pathlib import Path
from typing import Any

from map3d.errors import NotFound, UnknownFormat
from map3d.formats import FORMATS, find_format
from map3d.formats.detect import READABLE_FORMATS, check_stored, detect_format
from map3d.formats.gzip_file import unpacked_path
from map3d.formats.raster import RASTER
from map3d.formats.source_format import DocumentLinks, SourceFormat
from map3d.ingest.virtual_raster import find_virtual_sources, is_virtual
from map3d.messages import Message, message

_COMPANION_SUFFIXES = {".txt", ".md", ".json", ".pdf", ".html", ".sqlite", *(suffix for format in FORMATS for suffix in format.companions)}
_DOCUMENT_NAMES = ("license", "licence", "copying", "notice", "readme", "authors", "changelog", "changes")
"""Files that begin so and have no suffix accompany data, too."""
_SOURCE_SUFFIXES = {suffix for format in FORMATS for suffix in format.suffixes}
"""Files with these suffixes are reported if they are unreadable."""
_NO_LINKS = DocumentLinks(frozenset(), frozenset(), has_objects=True)

OnUnreadable = Callable[[Path, str], None]
"""Called with an unreadable file of a folder and the reason."""

_HEAD_BYTES = 4096
_MAX_NAME_CHARS = 64
_REMOVED_PARTS = 2
"""Equal parts of two paths, from the end, for which a file is the one of a removed asset: its name and that of its folder."""


@dataclass(frozen=True)
class SourceDocument:
    """`paths`: the document; for terrain, its rasters. `root`: the given folder, in which files that the document names may be; None for a document
    that was given itself, whose files are in its own folder. `virtual`: a virtual raster may be among the rasters. `appearances`: CityGML files
    given with it whose appearances target its surfaces. `grids`: rasters that RasterReliefs name, and where these say that they are."""

    name: str
    format: str
    paths: tuple[Path, ...]
    root: Path | None = None
    virtual: bool = False
    appearances: tuple[Path, ...] = ()
    grids: Mapping[Path, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def virtual_folders(self) -> dict[Path, Path]:
        """The virtual rasters, and the folders in which the rasters that they name must be."""
        return {path: self.root or path.parent for path in self.paths if is_virtual(path)} if self.virtual else {}

    @property
    def data_paths(self) -> tuple[Path, ...]:
        """The files with the data: the rasters, those that virtual ones name included."""
        named = [find_virtual_sources(path, folder) for path, folder in self.virtual_folders.items()]
        return (*self.paths, *sorted({path for paths in named for path in paths} - {path.resolve() for path in self.paths}))


def find_sources(
    paths: Iterable[Path],
    name: str | None = None,
    on_unreadable: OnUnreadable | None = None,
    on_ignored: OnUnreadable | None = None,
    known: Mapping[str, Path] | None = None,
    virtual: Collection[Path] = (),
    taken: Collection[str] = (),
    removed: Mapping[str, Path] | None = None,
) -> list[SourceDocument]:
    """Returns the given files, and every file of a known format below the given folders, in the order of the formats, each by path.

    The rasters below a given folder are one source, named after the folder that holds them all; those given one by one are one source, named after
    the first.

    `on_unreadable` is called for files in folders whose suffix announces a known format that their content is not; `on_ignored` for other files
    that hold a city or a raster in a format that map3d does not read, or whose format is unknown. `known`: the files of assets by name; a file whose
    name is needed for several keeps the one that it has there. `virtual`: those of the paths at which virtual rasters are read; the rasters that
    one in a folder names are not read a second time. `taken`: known names that a source has only if it is the file of that
    asset; else it is named after its folders and itself. `removed`: the files of removed assets by name; one that returns has its name back.

    CityGML files of a folder that have no city objects of their own, but geometry or appearances of others, are read with these.

    Raises UnknownFormat for a given file of unknown format and for a folder without any readable file; NotFound.
    """
    documents: list[_Group] = []
    grouped: list[_Group] = []
    given: dict[str, list[Path]] = {}
    for path in paths:
        if path.is_dir():
            found = _search_folder(path, on_unreadable or (lambda *_: None), on_ignored or (lambda *_: None), virtual=path in virtual)
            documents += [_Group(unpacked_path(file).stem, format, (file,), path) for file, format in found if not format.is_grouped]
            grouped += _group_files(found, path, virtual=path in virtual)
        elif not path.exists():
            raise NotFound(f"{path}: no such file or folder")
        elif (format := detect_format(path, virtual=path in virtual)).is_grouped:
            given.setdefault(format.name, []).append(path)
        else:
            documents.append(_Group(unpacked_path(path).stem, format, (path,)))
    for of_format, files in given.items():
        grouped.append(_Group(files[0].stem, find_format(of_format), tuple(files), virtual=any(path in virtual for path in files)))
    sources = _name_sources([*_link(documents), *grouped], name, _AssetNames(known or {}, taken, removed or {}))
    order = [format.name for format in FORMATS]
    return sorted(sources, key=lambda source: order.index(source.format))


def source_digest(source: SourceDocument) -> str:
    """Computes the digest of the document, the files beside it whose names begin with its stem, the libraries, images and code lists that it
    references, and the CityGML files whose geometry or appearances it has, with their images."""
    total = hashlib.sha256()
    for path in source.data_paths:
        for part in [path, *_find_companions(path, source)]:
            check_stored(part)
            total.update(part.name.encode())
            with part.open("rb") as file:
                total.update(hashlib.file_digest(file, "sha256").digest())
    for path, grid in sorted(source.grids.items()):
        total.update(json.dumps([path.name, {**grid, "file": path.name}], sort_keys=True).encode())
    return total.hexdigest()[:32]


def _search_folder(folder: Path, on_unreadable: OnUnreadable, on_ignored: OnUnreadable, *, virtual: bool = False) -> list[tuple[Path, SourceFormat]]:
    found: list[tuple[Path, SourceFormat]] = []
    unknown: list[tuple[Path, Message]] = []
    for path in sorted(path for path in _walk(folder) if path.exists() and not path.name.startswith(".")):
        if not path.suffix and path.name.lower().startswith(_DOCUMENT_NAMES):
            continue
        if path.suffix.lower() in _COMPANION_SUFFIXES:
            head = _read_head(path) if path.is_file() else b""
            if (known := next((format for format in FORMATS if format.detect_companion(head, path)), None)) is not None:
                found.append((path, known))
            elif path.suffix.lower() == ".json" and b'"CityJSON' in head:
                unknown.append((path, message("file-not-read", file=str(path), content="CityJSON; convert it to CityGML with citygml-tools")))
            continue
        try:
            found.append((path, detect_format(path, virtual=virtual)))
        except UnknownFormat as error:
            unknown.append((path, error.message))
    if not found:
        example = f" (found {unknown[0][0]}: {unknown[0][1].values['content']})" if unknown else ""
        raise UnknownFormat(f"{folder}: no readable file in this folder{example}; map3d reads {READABLE_FORMATS}")
    used = _used_documents(folder, found, [path for path, _ in unknown])
    for path, reason in unknown:
        if path.resolve() in used:
            continue
        if unpacked_path(path).suffix.lower() in _SOURCE_SUFFIXES:
            on_unreadable(path, str(reason))
        else:
            on_ignored(path, reason.values["content"])
    return _without_named(found, folder) if virtual else found


def _without_named(found: Sequence[tuple[Path, SourceFormat]], folder: Path) -> list[tuple[Path, SourceFormat]]:
    """Leaves out the rasters that a virtual raster of the folder names."""
    named = {source for path, format in found if format is RASTER for source in find_virtual_sources(path, folder)}
    return [(path, format) for path, format in found if format is not RASTER or path.resolve() not in named]


def _used_documents(folder: Path, found: Sequence[tuple[Path, SourceFormat]], unknown: Sequence[Path]) -> set[Path]:
    """Returns the files, such as code lists, that are no documents and are read with the documents of a folder."""
    suffixes = {unpacked_path(path).suffix.lower() for path in unknown}
    linked = [(path, format.links) for path, format in found if format.links is not None and suffixes.intersection(format.links.used_suffixes)]
    return {used for path, links in linked for used in links.find_used(path, folder)}


def _read_head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except OSError as error:
        raise NotFound(f"{path}: cannot read the file: {error.strerror}") from error


def _walk(folder: Path) -> Iterator[Path]:
    """Yields the files below a folder. Raises NotFound for a folder that cannot be read: its files must not seem to be gone."""

    def refuse(error: OSError) -> None:
        raise NotFound(f"{error.filename}: cannot read the folder: {error.strerror}") from error

    for place, _, names in os.walk(folder, onerror=refuse):
        yield from (Path(place, name) for name in names)


@dataclass(frozen=True)
class _Group:
    """Files of one source; `label`: the text from which its name is made."""

    label: str
    format: SourceFormat
    paths: tuple[Path, ...]
    root: Path | None = None
    virtual: bool = False
    appearances: tuple[Path, ...] = ()


def _link(documents: Sequence[_Group]) -> list[_Group]:
    """Gives documents the appearances that others have for them; leaves out files of folders that only serve others."""
    links = {group.paths[0]: group.format.links.find_links(group.paths[0], group.root) for group in documents if group.format.links is not None}
    if not any(found.geometry or found.targets for found in links.values()):
        return list(documents)
    used = {path for found in links.values() for path in found.geometry | found.targets}
    appearances: dict[Path, list[Path]] = {}
    for path, found in links.items():
        for target in found.targets:
            appearances.setdefault(target, []).append(path)
    linked = []
    for group in documents:
        path = group.paths[0].resolve()
        found = links.get(group.paths[0], _NO_LINKS)
        if found.has_objects or group.root is None or not (found.targets or path in used):
            folder = (group.root or path.parent).resolve()
            inside = [other for other in appearances.get(path, ()) if other.resolve().is_relative_to(folder)]
            linked.append(replace(group, appearances=tuple(sorted(inside))))
    return linked


def _group_files(found: Sequence[tuple[Path, SourceFormat]], root: Path, *, virtual: bool) -> list[_Group]:
    """Returns the files of a folder in each format that is grouped as one source: an elevation model and a photo belong together, and tiles make a
    mosaic. `virtual`: virtual rasters are read."""
    groups = []
    for format in (format for format in FORMATS if format.is_grouped):
        files = [path for path, of_format in found if of_format is format]
        if files:
            folder = Path(os.path.commonpath([path.parent for path in files]))
            label = files[0].stem if len(files) == 1 else folder.resolve().name
            groups.append(_Group(label, format, tuple(files), root if virtual else None, virtual))
    return groups


class _AssetNames:
    """The names that assets have, and those that removed ones had."""

    def __init__(self, known: Mapping[str, Path], taken: Collection[str], removed: Mapping[str, Path]) -> None:
        """`known`: the files of assets by name; `taken`: known names that only these files have; `removed`: the files of removed assets by name."""
        self.known = known
        self.removed = {name: path for name, path in removed.items() if name not in known}
        self._taken = frozenset(taken)
        self._names: dict[tuple[int, int], set[str]] = {}
        for name in self._taken:
            self._names.setdefault(_identity(known[name]), set()).add(name)

    def of_others(self, group: _Group) -> frozenset[str]:
        """Returns the taken names of files that are not the group's."""
        own = {name for path in group.paths for name in self._names.get(_identity(path), ())} if self._names else set()
        return self._taken - own if own else self._taken

    def of_absent(self, groups: Sequence[_Group]) -> frozenset[str]:
        """Returns the taken names of files that no group has."""
        return self._taken - {name for group in groups for path in group.paths for name in self._names.get(_identity(path), ())}


def _identity(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino


def _name_sources(groups: Sequence[_Group], name: str | None, names: _AssetNames) -> list[SourceDocument]:
    """Names sources after their files and numbers duplicates, without changing the names of known ones."""
    wanted = [asset_name(name or group.label) for group in groups]
    kept = {} if name else _kept_names(groups, wanted, names)
    used = set(kept.values())
    absent = names.of_absent(groups)
    sources = []
    for position, group in enumerate(groups):
        possible = _possible_names(group, wanted[position], with_folders=_is_given(group) or wanted[position] in absent)
        unique = kept.get(position) or next(_free(possible, wanted[position], used, group, None if name else names))
        used.add(unique)
        sources.append(SourceDocument(unique, group.format.name, group.paths, group.root, group.virtual, group.appearances))
    return sources


def _free(possible: Iterator[str], wanted: str, used: Collection[str], group: _Group, names: _AssetNames | None) -> Iterator[str]:
    """Yields the names that no other file has. A removed asset keeps a longer name than the wanted one for its file."""
    others = names.of_others(group) if names else frozenset()
    removed = names.removed if names else {}
    return (text for text in possible if text not in used and text not in others and (text == wanted or text not in removed))


def _is_given(group: _Group) -> bool:
    """Returns whether the group is a document that was given itself."""
    return group.root is None and not group.format.is_grouped


def _possible_names(group: _Group, wanted: str, *, with_folders: bool) -> Iterator[str]:
    """Yields the name; `with_folders`: also with the names of its folders, the nearest first; then with numbers from 2 on."""
    yield wanted
    if with_folders:
        words = [asset_name(part) for part in reversed(_folder_of(group).parts[1:])]
        longer = ["-".join([*reversed(words[:depth]), wanted]) for depth in range(1, len(words) + 1)]
        yield from (text for text in longer if len(text) <= _MAX_NAME_CHARS)
    yield from islice(_numbered(wanted), 1, None)


def _folder_of(group: _Group) -> Path:
    """Returns the folder that holds the file or, of rasters that are named after their folder, that folder."""
    folder = group.paths[0].absolute().parent
    if group.label == group.paths[0].stem or not group.format.is_grouped:
        return folder
    return Path(os.path.commonpath([path.absolute().parent for path in group.paths])).parent


def _kept_names(groups: Sequence[_Group], wanted: Sequence[str], names: _AssetNames) -> dict[int, str]:
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
        if (equal := _equal_parts(group.paths[0], path)) >= (_REMOVED_PARTS if known_name in removed else 1)
    ]
    rasters = {path.absolute(): position for position, group in enumerate(groups) if group.format.is_grouped for path in group.paths}
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


def _find_companions(path: Path, source: SourceDocument) -> list[Path]:
    beside = {other.resolve() for other in path.parent.glob(f"{_escape_glob(unpacked_path(path).stem)}.*") if other.is_file()}
    documents = {other.resolve() for other in source.appearances}
    format = find_format(source.format)
    if format.links is not None:
        documents |= format.links.find_geometry_documents(path, source.root)
    folder = path.parent if source.root is None else source.root
    referenced = {file for other in documents for file in format.find_files(other, folder)}
    return sorted((beside | format.find_files(path, source.root) | documents | referenced) - {path.resolve()})


def _escape_glob(stem: str) -> str:
    return re.sub(r"([\[\]*?])", r"[\1]", stem)
