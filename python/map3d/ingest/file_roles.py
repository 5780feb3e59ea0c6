"""Which files of a folder its documents use: textures, geometry, code lists, and files that say where a document lies. They are no documents."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from map3d.formats.gzip_file import unpacked_path
from map3d.formats.source_format import SourceFormat
from map3d.messages import Message, message


def find_used(
    documents: Sequence[tuple[Path, SourceFormat, Path]], candidates: Collection[Path], shown: Callable[[Path], str]
) -> Mapping[Path, Message]:
    """Returns those of the candidates that documents use, and what for. A file that several use is listed for the first one.

    `documents`: each with the folder in which the files that it names may be; `shown`: how messages name a file.
    """
    places = {path.resolve(): path for path in candidates}
    suffixes = {unpacked_path(path).suffix.lower() for path in candidates}
    used: dict[Path, Message] = {}
    for document, format, root in documents:
        if not suffixes.intersection(format.used_suffixes):
            continue
        for file, code in sorted(format.find_used(document, root).items()):
            path = places.get(file)
            if path is not None and path != document:
                used.setdefault(path, message(code, of=shown(document)))
    return used
