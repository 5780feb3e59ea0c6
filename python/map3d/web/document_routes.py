"""The JSON documents beside the tiles: manifest, attribute shards and columns, search index (spec/manifest.md).

They stand under /tiles/<rendering>/ and under /view/<rendering>/, whose page reads them as its own folder's, as in a published folder.
"""

import re
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from threading import Lock
from typing import Final

from flask import Blueprint, Response, current_app, request

from map3d.catalogue import Catalogue, Workspace
from map3d.errors import NotFound
from map3d.registry import Registry
from map3d.tiles.manifest import FILE_NAME, dump_document
from map3d.types import check_name
from map3d.web.compression import pack

documents = Blueprint("documents", __name__)
_opening: Final = Lock()

Stamp = tuple[tuple[int, int, int], ...]

_NUMBER: Final = re.compile(r"0|[1-9][0-9]{0,6}", re.ASCII)
"""Of a shard: ids are 32 bits, so shards have at most seven digits."""

_KEY: Final = re.compile(r"[0-9a-f]{16}", re.ASCII)
"""Of a column."""


@documents.get(f"/tiles/<rendering>/{FILE_NAME}")
@documents.get(f"/view/<rendering>/{FILE_NAME}")
def manifest(rendering: str) -> Response:
    path = workspace().manifest_path(check_name(rendering, "rendering"))
    try:
        return json_answer(path.read_bytes())
    except FileNotFoundError as error:
        raise NotFound(f"rendering {rendering!r} is not there, or nothing of it is rendered yet") from error


@documents.get("/tiles/<rendering>/objects/<shard>.json")
@documents.get("/view/<rendering>/objects/<shard>.json")
def shard(rendering: str, shard: str) -> Response:
    if not _NUMBER.fullmatch(shard):
        raise NotFound(f"no shard {shard[:64]!r}: shards have plain numbers")
    with Registry(registry_path(rendering)) as objects:
        return json_answer(dump_document(objects.shard(int(shard))))


@documents.get("/tiles/<rendering>/objects/search.json")
@documents.get("/view/<rendering>/objects/search.json")
def search(rendering: str) -> Response:
    path = registry_path(rendering)
    return json_answer(_search_bytes(path, _stamp(path)))


@documents.get("/tiles/<rendering>/objects/attributes.json")
@documents.get("/view/<rendering>/objects/attributes.json")
def attributes(rendering: str) -> Response:
    path = registry_path(rendering)
    return json_answer(_index_bytes(path, _stamp(path)))


@documents.get("/tiles/<rendering>/objects/columns/<column>.json")
@documents.get("/view/<rendering>/objects/columns/<column>.json")
def column(rendering: str, column: str) -> Response:
    path = registry_path(rendering)
    data = _column_bytes(path, column, _stamp(path)) if _KEY.fullmatch(column) else None
    if data is None:
        raise NotFound(f"no column {column[:64]!r}: objects/attributes.json lists those there are")
    return json_answer(data)


def workspace() -> Workspace:
    home: Workspace = current_app.config["WORKSPACE"]
    return home


def catalogue() -> Catalogue:
    """Opened at the first question, then kept."""
    with _opening:
        held: Catalogue | None = current_app.extensions.get("map3d.catalogue")
        if held is None:
            held = current_app.extensions["map3d.catalogue"] = workspace().open_catalogue()
    return held


def close() -> None:
    """Of the app in whose context it is called."""
    held: Catalogue | None = current_app.extensions.pop("map3d.catalogue", None)
    if held is not None:
        held.close()


def registry_path(rendering: str) -> Path:
    """Of the rendering's scene; raises NotFound."""
    path = workspace().registry_path(catalogue().rendering(check_name(rendering, "rendering")).scene)
    if not path.is_file():
        raise NotFound(f"the scene of rendering {rendering!r} has no objects yet")
    return path


def json_answer(data: bytes) -> Response:
    """With an ETag, to be asked for anew each time; compressed for who can read that."""
    response = Response(data, mimetype="application/json")
    response.set_etag(sha256(data).hexdigest()[:32], weak=True)
    response.headers["Cache-Control"] = "no-cache"
    response.make_conditional(request)
    return pack(response)


@lru_cache(maxsize=4)
def _search_bytes(path: Path, _state: Stamp) -> bytes:
    with Registry(path) as objects:
        return dump_document(objects.search())


@lru_cache(maxsize=4)
def _index_bytes(path: Path, _state: Stamp) -> bytes:
    with Registry(path) as objects:
        return dump_document(objects.attribute_index())


@lru_cache(maxsize=4)
def _column_bytes(path: Path, column: str, _state: Stamp) -> bytes | None:
    with Registry(path) as objects:
        found = objects.column(column)
    return None if found is None else dump_document(found)


def _stamp(path: Path) -> Stamp:
    """Differs once the registry has changed."""
    log = path.with_name(path.name + "-wal")
    return tuple((stat.st_ino, stat.st_mtime_ns, stat.st_size) for stat in (one.stat() for one in (path, log) if one.is_file()) if stat.st_size)
