"""Searches a folder, and the archives in it, for documents and rasters. Each file has one role: it is read, used by others, left out, or not read."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from map3d.errors import ImportFailed, Map3dError, NotFound, UnknownFormat
from map3d.formats import FORMATS
from map3d.formats.detect import READABLE_FORMATS, detect_format
from map3d.formats.gzip_file import unpacked_path
from map3d.formats.raster import RASTER
from map3d.formats.source_format import SourceFormat
from map3d.ingest.file_copies import find_backups, find_copies
from map3d.ingest.file_notes import unread
from map3d.ingest.file_roles import find_used
from map3d.ingest.other_files import is_written_by_map3d, note_others
from map3d.ingest.unpacked_archives import UnpackedFiles
from map3d.ingest.virtual_raster import find_virtual_sources
from map3d.messages import Message, message

_COMPANION_SUFFIXES: Final = {".txt", ".md", ".json", ".pdf", ".html", ".sqlite", *(suffix for format in FORMATS for suffix in format.companions)}
_DOCUMENT_NAMES: Final = ("license", "licence", "copying", "notice", "readme", "authors", "changelog", "changes")
"""Files that begin so and have no suffix accompany data, too."""
_SOURCE_SUFFIXES: Final = {suffix for format in FORMATS for suffix in format.suffixes}
"""Files with these suffixes are reported if they are unreadable."""
_HEAD_BYTES: Final = 4096

OnNote = Callable[[Path, Message], None]
"""Called with a file of a folder that is no document, and what it is or why it is not readable."""


@dataclass(frozen=True)
class FoundFile:
    """`root`: the folder in which the files that it names may be: the given one, or that of its unpacked archive."""

    path: Path
    format: SourceFormat
    root: Path


@dataclass
class FolderSearch:
    """`folder`: a given one; `unpacked`: its archives; `known`: the files of assets; `virtual`: virtual rasters are read. `on_unreadable` is called
    for files whose suffix announces a known format that their content is not, `on_note` for others that are no documents."""

    folder: Path
    unpacked: UnpackedFiles
    on_unreadable: OnNote
    on_note: OnNote
    known: Iterable[Path] = ()
    virtual: bool = False
    _found: list[FoundFile] = field(default_factory=list)
    _unknown: list[tuple[Path, Message]] = field(default_factory=list)
    _noted: set[Path] = field(default_factory=set)

    def run(self) -> list[FoundFile]:
        """Returns the documents and rasters by path. Raises UnknownFormat if there is none, ImportFailed if an archive that cannot be unpacked
        may hold them, NotFound for a folder that cannot be read."""
        paths = self._detect_all()
        self._report_archives()
        known = {path.absolute() for path in self.known}
        self._leave_out(find_backups(paths, [file.path for file in self._found], self._shown))
        used = self._used()
        files = [(file.path, file.format) for file in self._found]
        copies = find_copies(files, lambda path: (path in used, self.unpacked.place(path).absolute() in known), self._shown)
        self._leave_out({path: note for path, note in copies.items() if path not in used} | used)
        if not self._found:
            raise self._nothing_found()
        decided = {*(file.path for file in self._found), *(path for path, _ in self._unknown), *self._noted}
        others = [path for path in paths if path not in decided and not self.unpacked.is_archive(path)]
        for path, note in note_others(others, [(file.path, file.format, file.root) for file in self._found], self._noted, self._shown):
            self.on_note(path, note)
        for path, reason in self._unknown:
            if unpacked_path(path).suffix.lower() in _SOURCE_SUFFIXES:
                self.on_unreadable(path, reason)
            else:
                self.on_note(path, unread(reason.values["content"]))
        found = self._without_named() if self.virtual else self._found
        return sorted(found, key=lambda file: self.unpacked.place(file.path))

    def _detect_all(self) -> list[Path]:
        """Detects the formats of all files, and returns their paths."""
        archives = [archive.folder for archive in self.unpacked.within(self.folder) if archive.folder is not None]
        listed = []
        for root in (self.folder, *archives):
            for path in sorted(path for path in _walk(root) if path.exists()):
                if path.name.startswith(".") or path.is_dir():
                    self.on_note(path, message("left-own-folder" if path.is_dir() else "left-hidden"))
                    continue
                listed.append(path)
                if not self.unpacked.is_archive(path):
                    self._detect(path, root)
        return listed

    def _detect(self, path: Path, root: Path) -> None:
        if not path.suffix and path.name.lower().startswith(_DOCUMENT_NAMES):
            return
        if path.suffix.lower() in _COMPANION_SUFFIXES:
            head = _read_head(path) if path.is_file() else b""
            if (known := next((format for format in FORMATS if format.detect_companion(head, path)), None)) is not None:
                self._found.append(FoundFile(path, known, root))
            elif path.suffix.lower() == ".json" and b'"CityJSON' in head:
                content = "CityJSON; convert it to CityGML with citygml-tools"
                self._unknown.append((path, message("file-not-read", file=str(path), content=content)))
            return
        try:
            self._found.append(FoundFile(path, detect_format(path, virtual=self.virtual and root == self.folder), root))
        except UnknownFormat as error:
            self._unknown.append((path, error.message))

    def _used(self) -> dict[Path, Message]:
        """Returns the files that documents use: unknown ones, and those of formats whose files others may use."""
        candidates = [path for path, _ in self._unknown] + [file.path for file in self._found if file.format.links is None]
        return dict(find_used([(file.path, file.format, file.root) for file in self._found], candidates, self._shown))

    def _leave_out(self, notes: Mapping[Path, Message]) -> None:
        if notes:
            self._found = [file for file in self._found if file.path not in notes]
            self._unknown = [(path, reason) for path, reason in self._unknown if path not in notes]
            self._noted.update(notes)
            for path in sorted(notes):
                self.on_note(path, notes[path])

    def _report_archives(self) -> None:
        """Says which archives have no document, and which cannot be unpacked."""
        roots = {file.root for file in self._found}
        for archive in self.unpacked.within(self.folder):
            if archive.folder not in roots:
                self.on_note(archive.archive, message("left-archive-without-files"))
        for path, reason in self._broken_archives():
            self.on_unreadable(path, reason)

    def _broken_archives(self) -> list[tuple[Path, Message]]:
        return [(path, reason) for path, reason in self.unpacked.failed if path.is_relative_to(self.folder)]

    def _shown(self, path: Path) -> str:
        """Returns the path as messages name it: relative to the folder."""
        place = self.unpacked.place(path)
        return str(place.relative_to(self.folder) if place.is_relative_to(self.folder) else place)

    def _without_named(self) -> list[FoundFile]:
        """Leaves out the rasters that a virtual raster of the folder names."""
        rasters = [file for file in self._found if file.format is RASTER]
        named = {source for file in rasters for source in find_virtual_sources(file.path, self.folder)}
        return [file for file in self._found if file.format is not RASTER or file.path.resolve() not in named]

    def _nothing_found(self) -> Map3dError:
        if broken := self._broken_archives():
            return ImportFailed(broken[0][1])
        example = f" (found {self._unknown[0][0]}: {self._unknown[0][1].values['content']})" if self._unknown else ""
        return UnknownFormat(f"{self.folder}: no readable file in this folder{example}; map3d reads {READABLE_FORMATS}")


def _read_head(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except OSError as error:
        raise NotFound(f"{path}: cannot read the file: {error.strerror}") from error


def _walk(folder: Path) -> Iterator[Path]:
    """Yields the files below a folder, and in place of their files the folders that map3d wrote. Raises NotFound for a folder that cannot be read:
    its files must not seem to be gone."""

    def refuse(error: OSError) -> None:
        raise NotFound(f"{error.filename}: cannot read the folder: {error.strerror}") from error

    for place, folders, names in os.walk(folder, onerror=refuse):
        if Path(place) != folder and is_written_by_map3d(Path(place)):
            folders.clear()
            yield Path(place)
        else:
            yield from (Path(place, name) for name in names)
