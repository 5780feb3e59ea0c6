"""Finds the source documents of an import, names their assets, and detects whether they changed."""

import hashlib
import json
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from map3d.errors import NotFound
from map3d.formats import FORMATS, find_format
from map3d.formats.detect import check_stored, detect_format
from map3d.formats.gzip_file import unpacked_path
from map3d.formats.source_format import DocumentLinks, SourceFormat
from map3d.ingest.asset_names import AssetNames, FileGroup, name_groups
from map3d.ingest.file_copies import backed_up
from map3d.ingest.folder_search import FolderSearch, FoundFile, OnNote
from map3d.ingest.unpacked_archives import UnpackedFiles
from map3d.ingest.virtual_raster import find_virtual_sources, is_virtual
from map3d.messages import message

_NO_LINKS: Final = DocumentLinks(frozenset(), frozenset(), has_objects=True)


@dataclass(frozen=True)
class SourceDocument:
    """`paths`: the document; for terrain, its rasters. `root`: the given folder, in which files that the document names may be; None for a document
    that was given itself, whose files are in its own folder. `virtual`: a virtual raster may be among the rasters. `appearances`: CityGML files
    given with it whose appearances target its surfaces. `grids`: rasters that RasterReliefs name, and where these say that they are. `places`: the
    paths as the user knows them: those of unpacked files lead through their archive."""

    name: str
    format: str
    paths: tuple[Path, ...]
    root: Path | None = None
    virtual: bool = False
    appearances: tuple[Path, ...] = ()
    grids: Mapping[Path, Mapping[str, Any]] = field(default_factory=dict)
    places: tuple[Path, ...] = ()

    @property
    def place(self) -> Path:
        """The path of the document, or of the first raster, as the user knows it."""
        return (self.places or self.paths)[0]

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
    on_unreadable: OnNote = lambda *_: None,
    on_note: OnNote = lambda *_: None,
    known: Mapping[str, Path] | None = None,
    virtual: Collection[Path] = (),
    taken: Collection[str] = (),
    removed: Mapping[str, Path] | None = None,
    unpacked: UnpackedFiles | None = None,
) -> list[SourceDocument]:
    """Returns the given files, and every file of a known format below the given folders, in the order of the formats, each by path.

    The rasters below a given folder are one source, named after the folder that holds them all; those given one by one are one source, named after
    the first.

    `on_unreadable` is called for files in folders whose suffix announces a known format that their content is not; `on_note` for other files
    that are no documents: those that documents use, copies and backups of others, and those that hold a city or a raster in a format that map3d does
    not read, or whose format is unknown. A given file is always read. `known`: the files of assets by name; a file whose
    name is needed for several keeps the one that it has there. `virtual`: those of the paths at which virtual rasters are read; the rasters that
    one in a folder names are not read a second time. `taken`: known names that a source has only if it is the file of that
    asset; else it is named after its folders and itself. `removed`: the files of removed assets by name; one that returns has its name back.
    `unpacked`: the archives among the paths and in the folders.

    CityGML files of a folder that have no city objects of their own, but geometry or appearances of others, are read with these.

    Raises UnknownFormat for a given file of unknown format and for a folder without any readable file; ImportFailed if that may be since an archive
    cannot be unpacked; NotFound.
    """
    known, unpacked = known or {}, unpacked or UnpackedFiles(tuple(paths := list(paths)))
    documents: list[FileGroup] = []
    grouped: list[FileGroup] = []
    given: dict[str, list[Path]] = {}
    for path in paths:
        if path.is_dir():
            found = FolderSearch(path, unpacked, on_unreadable, on_note, known.values(), path in virtual).run()
            documents += [_document(file.path, file.format, unpacked, file.root) for file in found if not file.format.is_grouped]
            grouped += _group_files(found, path, unpacked, virtual=path in virtual)
        elif not path.exists():
            raise NotFound(f"{path}: no such file or folder")
        elif (format := detect_format(path, virtual=path in virtual)).is_grouped:
            given.setdefault(format.name, []).append(path)
        else:
            documents.append(_document(path, format, unpacked))
    for of_format, files in given.items():
        is_virtual_read = any(path in virtual for path in files)
        grouped.append(FileGroup(files[0].stem, find_format(of_format), tuple(files), tuple(files), virtual=is_virtual_read))
    groups = [*_link(documents, on_note), *grouped]
    names = name_groups(groups, name, AssetNames(known, taken, removed or {}))
    order = [format.name for format in FORMATS]
    return sorted(map(_source, groups, names), key=lambda source: order.index(source.format))


def _document(path: Path, format: SourceFormat, unpacked: UnpackedFiles, root: Path | None = None) -> FileGroup:
    return FileGroup(unpacked_path(path).stem, format, (path,), (unpacked.place(path),), root)


def _source(group: FileGroup, name: str) -> SourceDocument:
    return SourceDocument(name, group.format.name, group.paths, group.root, group.virtual, group.appearances, places=group.places)


def source_digest(source: SourceDocument) -> str:
    """Computes the digest of the document, the files beside it whose names begin with its stem, the libraries, images and code lists that it
    references, and the CityGML files whose geometry or appearances it has, with their images."""
    total = hashlib.sha256()
    for path in source.data_paths:
        for part in [path, *_find_companions(path, source)]:
            check_stored(part)
            total.update(os.fsencode(part.name))
            with part.open("rb") as file:
                total.update(hashlib.file_digest(file, "sha256").digest())
    for path, grid in sorted(source.grids.items()):
        total.update(json.dumps([path.name, {**grid, "file": path.name}], sort_keys=True).encode())
    return total.hexdigest()[:32]


def _link(documents: Sequence[FileGroup], on_note: OnNote) -> list[FileGroup]:
    """Gives documents the appearances that others have for them; leaves out files of folders that only serve others."""
    links = {group.paths[0]: group.format.links.find_links(group.paths[0], group.root) for group in documents if group.format.links is not None}
    if not any(found.geometry or found.targets for found in links.values()):
        return list(documents)
    users = {used: path for path, found in reversed(links.items()) for used in found.geometry | found.targets}
    appearances: dict[Path, list[Path]] = {}
    for path, found in links.items():
        for target in found.targets:
            appearances.setdefault(target, []).append(path)
    linked = []
    for group in documents:
        path = group.paths[0].resolve()
        found = links.get(group.paths[0], _NO_LINKS)
        if found.has_objects or group.root is None or not (found.targets or path in users):
            folder = (group.root or path.parent).resolve()
            inside = [other for other in appearances.get(path, ()) if other.resolve().is_relative_to(folder)]
            linked.append(replace(group, appearances=tuple(sorted(inside))))
        else:
            code, of = ("used-as-appearance", min(found.targets)) if found.targets else ("used-as-geometry", users[path])
            on_note(group.paths[0], message(code, of=of.name))
    return linked


def _group_files(found: Sequence[FoundFile], root: Path, unpacked: UnpackedFiles, *, virtual: bool) -> list[FileGroup]:
    """Returns the files of a folder in each format that is grouped as one source: an elevation model and a photo belong together, and tiles make a
    mosaic. `virtual`: virtual rasters are read."""
    groups = []
    for format in (format for format in FORMATS if format.is_grouped):
        files = tuple(file.path for file in found if file.format is format)
        if files:
            places = tuple(map(unpacked.place, files))
            folder = Path(os.path.commonpath([path.parent for path in places])).resolve()
            label = places[0].stem if len(files) == 1 else folder.stem if folder.is_file() else folder.name
            groups.append(FileGroup(label, format, files, places, root if virtual else None, virtual))
    return groups


def _find_companions(path: Path, source: SourceDocument) -> list[Path]:
    found = path.parent.glob(f"{_escape_glob(unpacked_path(path).stem)}.*")
    beside = {other.resolve() for other in found if other.is_file() and backed_up(other.name) is None}
    documents = {other.resolve() for other in source.appearances}
    format = find_format(source.format)
    if format.links is not None:
        documents |= format.links.find_geometry_documents(path, source.root)
    folder = path.parent if source.root is None else source.root
    referenced = {file for other in documents for file in format.find_files(other, folder)}
    return sorted((beside | format.find_files(path, source.root) | documents | referenced) - {path.resolve()})


def _escape_glob(stem: str) -> str:
    return re.sub(r"([\[\]*?])", r"[\1]", stem)
