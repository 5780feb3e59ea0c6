"""CityGML, as its row in the list of formats. The core detects and reads it."""

import re
from collections.abc import Iterator, Sequence
from mmap import mmap
from pathlib import Path
from typing import Final

from map3d import _core
from map3d.formats.citygml_links import find_document_links, find_geometry_documents
from map3d.formats.file_names import MAX_NAME_BYTES, FileNames, FindNames, find_texts, match, xml_name
from map3d.formats.source_format import IMAGE_SUFFIXES, LinkedDocuments, MissingFiles, SourceFormat

_NAME: Final = "citygml"
# Every pattern is bounded or excludes what follows it, so that a hostile file costs no more than its length.
_IMAGE_TAGS: Final = (b"imageURI>", b"textureMap>")
_OTHER_TAGS: Final = (b"libraryObject>", b"fileName>", b"fileReference>")
_LIBRARY_TAGS: Final = _OTHER_TAGS[:1]
_MODEL_SUFFIXES: Final = (".gml", ".xml", ".obj")
"""Those of libraries that are read."""
_CODE_LIST: Final = re.compile(rb"""codeSpace=["']([^"'<>]{1,4096}\.(?:xml|gml))["']""", re.IGNORECASE)


def _find_files(path: Path, root: Path | None = None) -> set[Path]:
    return _existing(path, _find_elements, root) | _find_code_lists(path, root)


def _find_code_lists(path: Path, root: Path | None = None) -> set[Path]:
    """Returns the dictionaries of codes that a document names."""
    return _existing(path, match(_CODE_LIST), root)


def _existing(path: Path, find: FindNames, root: Path | None) -> set[Path]:
    names = FileNames.of(path, root)
    return {file for text in find_texts(path, find) if (file := names.find(xml_name(text))) is not None}


def _find_missing(path: Path, root: Path | None = None) -> MissingFiles:
    names = FileNames.of(path, root)
    images, others = (
        {name for name in map(xml_name, find_texts(path, find)) if names.is_file_name(name)} for find in (_find_images, _find_other_files)
    )
    missing_images, missing_others = ({name for name in found if names.find(name) is None} for found in (images, others))
    return MissingFiles(sorted(missing_images | missing_others), len(images), len(missing_images))


def _find_used(path: Path, root: Path | None = None) -> dict[Path, str]:
    """Returns the textures, code lists and libraries of geometry that a document names; they are read with it."""
    models = {file for file in _existing(path, _find_libraries, root) if file.suffix.lower() in _MODEL_SUFFIXES}
    return {
        **dict.fromkeys(models | find_geometry_documents(path, root), "used-as-geometry"),
        **dict.fromkeys(_find_code_lists(path, root), "used-as-code-list"),
        **dict.fromkeys(_existing(path, _find_images, root), "used-as-texture"),
    }


def _find_libraries(text: mmap | bytes) -> Iterator[bytes]:
    return _find_elements(text, _LIBRARY_TAGS)


def _find_images(text: mmap | bytes) -> Iterator[bytes]:
    return _find_elements(text, _IMAGE_TAGS)


def _find_other_files(text: mmap | bytes) -> Iterator[bytes]:
    return _find_elements(text, _OTHER_TAGS)


def _find_elements(text: mmap | bytes, tags: Sequence[bytes] = _IMAGE_TAGS + _OTHER_TAGS) -> Iterator[bytes]:
    """Yields the content of the elements that contain file names. It uses plain search, because city models are large and such elements rare."""
    for tag in tags:
        at = text.find(tag)
        while at >= 0:
            start = at + len(tag)
            end = text.find(b"<", start, start + MAX_NAME_BYTES + 1)
            if end > start and b">" not in (name := text[start:end]):
                yield name
            at = text.find(tag, start)


CITYGML: Final = SourceFormat(
    name=_NAME,
    title="CityGML",
    readable="CityGML (.gml, .xml)",
    uploads="CityGML",
    version=_core.READER_VERSIONS[_NAME],
    detect=lambda head, _path: _core.detect_format(head) == _NAME,
    parser="map3d.ingest.parse_document:open_document_parser",
    suffixes=(".gml", ".citygml"),
    companions=(".jpg", ".jpeg", ".png", ".bmp", ".gif", ".tga", ".xsd"),
    options=("theme", "lod", "transparency"),
    sparse_options=("interiors", "at"),
    names_files=True,
    find_files=_find_files,
    find_missing=_find_missing,
    find_used=_find_used,
    used_suffixes=(".xml", ".gml", ".obj", *IMAGE_SUFFIXES),
    links=LinkedDocuments(find_document_links, find_geometry_documents),
)
