"""Wavefront OBJ, as its row in the list of formats. The core detects and reads it."""

import re
from pathlib import Path
from typing import Final

from map3d import _core
from map3d.formats.file_names import FileNames, find_texts, match
from map3d.formats.model_place import find_model_place
from map3d.formats.source_format import IMAGE_SUFFIXES, MissingFiles, SourceFormat

_NAME: Final = "obj"
# Every pattern is bounded, so that a hostile file costs no more than its length.
_LIBRARIES: Final = match(re.compile(rb"^mtllib[ \t]([^\r\n]{1,4096})", re.MULTILINE))
_IMAGES: Final = match(re.compile(rb"^[ \t]{0,64}(?:map_\w{1,16}|bump|disp|decal|norm|refl)[ \t]([^\r\n]{1,4096})", re.MULTILINE | re.IGNORECASE))


def _library_names(path: Path, folder: FileNames) -> set[str]:
    return {name for statement in find_texts(path, _LIBRARIES) for name in folder.finder.library_names(statement)}


def _images(library: Path, folder: FileNames) -> dict[str, Path | None]:
    """Returns the images that a library names, None for those that are not there. They are beside the library or beside the document."""
    names = {name for statement in find_texts(library, _IMAGES) if (name := _core.texture_map_name(statement))}
    places = (folder.beside(library), folder)
    return {name: next(filter(None, (place.find(name) for place in places)), None) for name in names if folder.is_file_name(name)}


def _find_files(path: Path, root: Path | None = None) -> set[Path]:
    return _find_libraries(path, root) | _find_images(path, root) | _find_places(path, root)


def _find_libraries(path: Path, root: Path | None) -> set[Path]:
    folder = FileNames.of(path, root)
    return {library for name in _library_names(path, folder) if (library := folder.find(name)) is not None}


def _find_images(path: Path, root: Path | None) -> set[Path]:
    folder = FileNames.of(path, root)
    images = (image for library in _find_libraries(path, root) for image in _images(library, folder).values())
    return {image for image in images if image is not None}


def _find_places(path: Path, root: Path | None = None) -> set[Path]:
    """Returns the files that say where a model lies."""
    place = find_model_place(path, root)
    return set() if place is None else {file.resolve() for file in place.files}


def _find_used(path: Path, root: Path | None = None) -> dict[Path, str]:
    return {**dict.fromkeys(_find_places(path, root), "used-as-place"), **dict.fromkeys(_find_images(path, root), "used-as-texture")}


def _find_missing(path: Path, root: Path | None = None) -> MissingFiles:
    folder = FileNames.of(path, root)
    found = {name: folder.find(name) for name in _library_names(path, folder) if folder.is_file_name(name)}
    images = [image for library in {*found.values()} if library is not None for image in _images(library, folder).items()]
    missing_images = {name for name, file in images if file is None}
    missing = {name for name, library in found.items() if library is None}
    return MissingFiles(sorted(missing | missing_images), len({name for name, _ in images}), len(missing_images))


OBJ: Final = SourceFormat(
    name=_NAME,
    title="OBJ",
    readable="Wavefront OBJ (.obj)",
    uploads="OBJ with textures",
    version=_core.READER_VERSIONS[_NAME],
    detect=lambda head, _path: _core.detect_format(head) == _NAME,
    parser="map3d.ingest.parse_document:open_document_parser",
    suffixes=(".obj",),
    companions=(".mtl", ".jpg", ".jpeg", ".png", ".bmp", ".gif", ".tga"),
    options=("up", "split", "transparency"),
    sparse_options=("offset", "unit"),
    has_crs=False,
    names_files=True,
    find_files=_find_files,
    find_missing=_find_missing,
    find_used=_find_used,
    used_suffixes=(".xyz", ".xml", *IMAGE_SUFFIXES),
    find_places=_find_places,
    find_place=find_model_place,
)
