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
from map3d.ingest.document_links import DocumentLinks, find_document_links, find_geometry_documents
from map3d.ingest.formats import RASTER_FORMATS, READABLE_FORMATS, Format, check_stored, detect_format, has_world_file
from map3d.ingest.gzip_file import unpacked_path
from map3d.ingest.referenced_files import find_code_lists, find_referenced_files
from map3d.ingest.virtual_raster import find_virtual_sources, is_virtual

_COMPANION_SUFFIXES = (
    ".mtl", ".jpg", ".jpeg", ".png", ".bmp", ".gif", ".tga", ".txt", ".md", ".json", ".pdf", ".html", ".prj", ".xsd", ".sqlite",
    *(suffix for format in RASTER_FORMATS for suffix in format.world_files),
)  # fmt: skip
_DOCUMENT_NAMES = ("license", "licence", "copying", "notice", "readme", "authors", "changelog", "changes")
"""Files that begin so and have no suffix accompany data, too."""
_SOURCE_SUFFIXES = (".gml", ".citygml", ".obj", *(suffix for format in RASTER_FORMATS for suffix in format.suffixes))
"""Files with these suffixes are reported if they are unreadable."""
_CODE_LIST_SUFFIXES = (".xml", ".gml")

_NO_LINKS = DocumentLinks(frozenset(), frozenset(), has_objects=True)

_ORDER: Mapping[Format, int] = {"citygml": 0, "obj": 1, "raster": 2}
"""CityGML files name the CRS of the scene, which OBJ files and rasters may lack."""

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
    format: Format
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
    on_left_alone: OnUnreadable | None = None,
    known: Mapping[str, Path] | None = None,
    virtual: Collection[Path] = (),
    taken: Collection[str] = (),
    removed: Mapping[str, Path] | None = None,
) -> list[SourceDocument]:
    """Returns the given files, and every file of a known format below the given folders: CityGML, OBJ, then rasters, each by path.

    The rasters below a given folder are one source, named after the folder that holds them all; those given one by one are one source, named after
    the first.

    `on_unreadable` is called for files in folders whose suffix announces a known format that their content is not; `on_left_alone` for other files
    that hold a city or a raster in a format that map3d does not read, or whose format is unknown. `known`: the files of assets by name; a file whose
    name is needed for several keeps the one that it has there. `virtual`: those of the paths at which virtual rasters are read; the rasters that
    one in a folder names are not read a second time. `taken`: known names that a source has only if it is the file of that
    asset; else it is named after its folders and itself. `removed`: the files of removed assets by name; one that returns has its name back.

    CityGML files of a folder that have no city objects of their own, but geometry or appearances of others, are read with these.

    Raises UnknownFormat for a given file of unknown format and for a folder without any readable file; NotFound.
    """
    documents: list[_Group] = []
    terrains: list[_Group] = []
    rasters: list[Path] = []
    for path in paths:
        if path.is_dir():
            found = _search_folder(path, on_unreadable or (lambda *_: None), on_left_alone or (lambda *_: None), virtual=path in virtual)
            documents += [_Group(unpacked_path(file).stem, format, (file,), path) for file, format in found if format != "raster"]
            terrains += _group_rasters([file for file, format in found if format == "raster"], path if path in virtual else None)
        elif not path.exists():
            raise NotFound(f"{path}: no such file or folder")
        elif (format := detect_format(path, virtual=path in virtual)) == "raster":
            rasters.append(path)
        else:
            documents.append(_Group(unpacked_path(path).stem, format, (path,)))
    if rasters:
        terrains.append(_Group(rasters[0].stem, "raster", tuple(rasters), virtual=any(path in virtual for path in rasters)))
    sources = _name_sources([*_link(documents), *terrains], name, _AssetNames(known or {}, taken, removed or {}))
    return sorted(sources, key=lambda source: _ORDER[source.format])


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


def _search_folder(folder: Path, on_unreadable: OnUnreadable, on_left_alone: OnUnreadable, *, virtual: bool = False) -> list[tuple[Path, Format]]:
    found: list[tuple[Path, Format]] = []
    unknown: list[tuple[Path, str]] = []
    for path in sorted(path for path in _walk(folder) if path.exists() and not path.name.startswith(".")):
        if not path.suffix and path.name.lower().startswith(_DOCUMENT_NAMES):
            continue
        if path.suffix.lower() in _COMPANION_SUFFIXES:
            head = _read_head(path) if path.is_file() else b""
            if has_world_file(path, head):
                found.append((path, "raster"))
            elif path.suffix.lower() == ".json" and b'"CityJSON' in head:
                unknown.append((path, "CityJSON; convert it to CityGML with citygml-tools"))
            continue
        try:
            found.append((path, detect_format(path, virtual=virtual)))
        except UnknownFormat as error:
            unknown.append((path, str(error)))
    if not found:
        example = f" (found {unknown[0][1].partition(';')[0]})" if unknown else ""
        raise UnknownFormat(f"{folder}: no readable file in this folder{example}; map3d reads {READABLE_FORMATS}")
    used = _used_documents(folder, found, [path for path, _ in unknown])
    for path, reason in unknown:
        if path.resolve() in used:
            continue
        if unpacked_path(path).suffix.lower() in _SOURCE_SUFFIXES:
            on_unreadable(path, reason)
        else:
            on_left_alone(path, reason.removeprefix(f"{path}: ").partition("; map3d reads")[0])
    return _without_named(found, folder) if virtual else found


def _without_named(found: Sequence[tuple[Path, Format]], folder: Path) -> list[tuple[Path, Format]]:
    """Leaves out the rasters that a virtual raster of the folder names."""
    named = {source for path, format in found if format == "raster" for source in find_virtual_sources(path, folder)}
    return [(path, format) for path, format in found if format != "raster" or path.resolve() not in named]


def _used_documents(folder: Path, found: Sequence[tuple[Path, Format]], unknown: Sequence[Path]) -> set[Path]:
    """Returns the code lists and libraries of geometry that the CityGML files of a folder name; they are read with these files."""
    if not any(unpacked_path(path).suffix.lower() in _CODE_LIST_SUFFIXES for path in unknown):
        return set()
    documents = [path for path, format in found if format == "citygml"]
    return {used for path in documents for used in find_code_lists(path, folder) | find_geometry_documents(path, folder)}


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
    format: Format
    paths: tuple[Path, ...]
    root: Path | None = None
    virtual: bool = False
    appearances: tuple[Path, ...] = ()


def _link(documents: Sequence[_Group]) -> list[_Group]:
    """Gives CityGML files the appearances that others have for them; leaves out files of folders that only serve others."""
    links = {group.paths[0]: find_document_links(group.paths[0], group.root) for group in documents if group.format == "citygml"}
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


def _group_rasters(rasters: Sequence[Path], virtual: Path | None) -> list[_Group]:
    """Returns the rasters of a folder as one source: an elevation model and a photo belong together, and tiles make a mosaic. `virtual`: the folder,
    if virtual rasters are read."""
    if not rasters:
        return []
    folder = Path(os.path.commonpath([path.parent for path in rasters]))
    return [_Group(rasters[0].stem if len(rasters) == 1 else folder.resolve().name, "raster", tuple(rasters), virtual, virtual is not None)]


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
        sources.append(SourceDocument(unique, group.format, group.paths, group.root, group.virtual, group.appearances))
    return sources


def _free(possible: Iterator[str], wanted: str, used: Collection[str], group: _Group, names: _AssetNames | None) -> Iterator[str]:
    """Yields the names that no other file has. A removed asset keeps a longer name than the wanted one for its file."""
    others = names.of_others(group) if names else frozenset()
    removed = names.removed if names else {}
    return (text for text in possible if text not in used and text not in others and (text == wanted or text not in removed))


def _is_given(group: _Group) -> bool:
    """Returns whether the group is a document that was given itself."""
    return group.root is None and group.format != "raster"


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
    if group.label == group.paths[0].stem or group.format != "raster":
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
    rasters = {path.absolute(): position for position, group in enumerate(groups) if group.format == "raster" for path in group.paths}
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
    if source.format == "citygml":
        documents |= find_geometry_documents(path, source.root)
    folder = path.parent if source.root is None else source.root
    referenced = {file for other in documents for file in find_referenced_files(other, folder)}
    return sorted((beside | find_referenced_files(path, source.root) | documents | referenced) - {path.resolve()})


def _escape_glob(stem: str) -> str:
    return re.sub(r"([\[\]*?])", r"[\1]", stem)
