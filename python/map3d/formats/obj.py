"""Wavefront OBJ, as its row in the list of formats. The core detects and reads it."""

import re
from pathlib import Path
from typing import Final

from map3d import _core
from map3d.formats.file_names import FileNames, existing_files, match, missing, names_in
from map3d.formats.model_place import find_model_place
from map3d.formats.source_format import IMAGE_SUFFIXES, MissingFiles, SourceFormat

_NAME: Final = "obj"
# Every pattern is bounded, so that a hostile file costs no more than its length.
_LIBRARIES: Final = match(re.compile(rb"^mtllib[ \t]([^\r\n]{1,4096})", re.MULTILINE))
_IMAGES: Final = match(re.compile(rb"^[ \t]{0,64}(?:map_\w{1,16}|bump|disp|decal|norm|refl)[ \t]([^\r\n]{1,4096})", re.MULTILINE | re.IGNORECASE))


def _find_files(path: Path, root: Path | None = None) -> set[Path]:
    return _find_libraries(path, root) | _find_images(path, root) | _find_places(path, root)


def _find_libraries(path: Path, root: Path | None) -> set[Path]:
    return set(existing_files(path, _LIBRARIES, [FileNames.of(path, root)]))


def _find_images(path: Path, root: Path | None) -> set[Path]:
    folder = FileNames.of(path, root)
    libraries = _find_libraries(path, root)
    return {image for library in libraries for image in existing_files(library, _IMAGES, [folder.beside(library), folder])}


def _find_places(path: Path, root: Path | None = None) -> set[Path]:
    """Returns the files that say where a model lies."""
    place = find_model_place(path, root)
    return set() if place is None else {file.resolve() for file in place.files}


def _find_used(path: Path, root: Path | None = None) -> dict[Path, str]:
    return {**dict.fromkeys(_find_places(path, root), "used-as-place"), **dict.fromkeys(_find_images(path, root), "used-as-texture")}


def _find_missing(path: Path, root: Path | None = None) -> MissingFiles:
    folder = FileNames.of(path, root)
    libraries = _find_libraries(path, root)
    images, missing_images = set[str](), set[str]()
    for library in libraries:
        images |= names_in(library, _IMAGES)
        missing_images |= missing(library, _IMAGES, [folder.beside(library), folder])
    return MissingFiles(sorted(missing(path, _LIBRARIES, [folder]) | missing_images), len(images), len(missing_images))


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
