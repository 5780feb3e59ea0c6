"""What the list of formats says of each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.formats.model_place import ModelPlace

GIB: Final = 1 << 30
IMAGE_SUFFIXES: Final = (".tif", ".tiff", ".jp2", ".jpg", ".jpeg", ".png")
"""Suffixes of textures that may be rasters of their own, too."""


@dataclass(frozen=True)
class MissingFiles:
    """`names`: of referenced files that are not there, sorted. `images`: number of the images referenced, `missing_images`: of those not there."""

    names: list[str]
    images: int
    missing_images: int


@dataclass(frozen=True)
class DocumentLinks:
    """`geometry`: documents to whose elements this one refers by XLink; `targets`: those whose surfaces its appearances target. `has_objects`: the
    document has city objects of its own."""

    geometry: frozenset[Path]
    targets: frozenset[Path]
    has_objects: bool


FindFiles = Callable[[Path, Path | None], set[Path]]
"""(document, root) → existing files inside the root, by default the document's folder."""


@dataclass(frozen=True)
class LinkedDocuments:
    """How documents of a format refer to each other. `find_links`: the links of a document; `find_geometry_documents`: the documents whose geometry
    it draws, also by way of others."""

    find_links: Callable[[Path, Path | None], DocumentLinks]
    find_geometry_documents: FindFiles


@dataclass(frozen=True)
class SourceFormat:
    """A format of files that are imported: a row of FORMATS.

    `name`: in assets and reports; `title`: what people read, and translate; `readable`: its part of the sentence of readable formats; `uploads`: the
    same in the studio. `version`: raised when the reader makes another asset of the same file, so that existing scenes get the better one
    (tests/ingest/test_import_inputs.py). `detect`: (first bytes, path) → whether a file is in the format; `parser`: the entry of the process that
    parses.

    `suffixes`: files with these are reported if they are unreadable; `companions`: those of files that accompany documents and are none themselves,
    unless `detect_companion` says so.

    `options`: those of an import that the reader has; of `sparse_options`, an asset records only what differs from the default, since the reader had
    them later. `has_crs`: files name their coordinate system; of others it may be unknown. `is_grouped`: the files of a folder are one source.
    `names_files`: documents name other files, in the folder that was given; `find_files` finds those that are there, `find_missing` those that are
    not. `find_used`: the files of the `used_suffixes` that are read with a document and are no documents of their own → code of the message that
    says what for. `find_places`: files that say where a file lies; `find_place`: what they say of a model. `links`: documents refer to each other.
    `has_checkpoints`: a broken import resumes from its checkpoints. `cpu_s`: processor time for each 100 MB or part of it; `memory_bytes`: for
    files up to that size."""

    name: str
    title: str
    readable: str
    uploads: str
    version: int
    detect: Callable[[bytes, Path], bool]
    parser: str
    suffixes: tuple[str, ...]
    companions: tuple[str, ...] = ()
    detect_companion: Callable[[bytes, Path], bool] = lambda _head, _path: False
    options: tuple[str, ...] = ()
    sparse_options: tuple[str, ...] = ()
    has_crs: bool = True
    is_grouped: bool = False
    names_files: bool = False
    find_files: FindFiles = lambda _path, _root: set()
    find_missing: Callable[[Path, Path | None], MissingFiles] = lambda _path, _root: MissingFiles([], 0, 0)
    find_used: Callable[[Path, Path | None], Mapping[Path, str]] = lambda _path, _root: {}
    used_suffixes: tuple[str, ...] = ()
    find_places: Callable[[Path], set[Path]] = lambda _path: set()
    find_place: Callable[[Path, Path | None], ModelPlace | None] = lambda _path, _root: None
    links: LinkedDocuments | None = None
    has_checkpoints: bool = False
    cpu_s: int = 60
    memory_bytes: int = GIB
