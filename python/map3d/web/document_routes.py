"""Routes of the JSON documents of a rendering: manifest, attribute shards and columns, search index (spec/manifest.md).

Each is available under /tiles/<rendering>/ and under /view/<rendering>/, where the viewer's page finds it in its own folder, as in a published one.
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
from map3d.web.compression import compress

documents = Blueprint("documents", __name__)
_open_lock: Final = Lock()

FileState = tuple[tuple[int, int, int], ...]
"""(inode, time of change, size) of the database and its write-ahead log."""

_SHARD: Final = re.compile(r"0|[1-9][0-9]{0,6}", re.ASCII)
"""Shard numbers have at most seven digits, because ids have 32 bits."""

_COLUMN: Final = re.compile(r"[0-9a-f]{16}", re.ASCII)


@documents.get(f"/tiles/<rendering>/{FILE_NAME}")
@documents.get(f"/view/<rendering>/{FILE_NAME}")
def manifest(rendering: str) -> Response:
    path = workspace().manifest_path(check_name(rendering, "rendering"))
    try:
        return json_response(path.read_bytes())
    except FileNotFoundError as error:
        raise NotFound(f"no rendering {rendering!r}, or it has no tiles yet; run: map3d render {rendering}") from error


@documents.get("/tiles/<rendering>/objects/<shard>.json")
@documents.get("/view/<rendering>/objects/<shard>.json")
def shard(rendering: str, shard: str) -> Response:
    if not _SHARD.fullmatch(shard):
        raise NotFound(f"no shard {shard[:64]!r}; shard names are plain numbers")
    with Registry(registry_path(rendering)) as objects:
        return json_response(dump_document(objects.shard(int(shard))))


@documents.get("/tiles/<rendering>/objects/search.json")
@documents.get("/view/<rendering>/objects/search.json")
def search(rendering: str) -> Response:
    path = registry_path(rendering)
    return json_response(_search_bytes(path, _file_state(path)))


@documents.get("/tiles/<rendering>/objects/attributes.json")
@documents.get("/view/<rendering>/objects/attributes.json")
def attributes(rendering: str) -> Response:
    path = registry_path(rendering)
    return json_response(_index_bytes(path, _file_state(path)))


@documents.get("/tiles/<rendering>/objects/columns/<column>.json")
@documents.get("/view/<rendering>/objects/columns/<column>.json")
def column(rendering: str, column: str) -> Response:
    path = registry_path(rendering)
    data = _column_bytes(path, column, _file_state(path)) if _COLUMN.fullmatch(column) else None
    if data is None:
        raise NotFound(f"no column {column[:64]!r}; objects/attributes.json lists the columns")
    return json_response(data)


def workspace() -> Workspace:
    home: Workspace = current_app.config["WORKSPACE"]
    return home


def catalogue() -> Catalogue:
    """Returns the catalogue of the current app, opened on first use."""
    with _open_lock:
        opened: Catalogue | None = current_app.extensions.get("map3d.catalogue")
        if opened is None:
            opened = current_app.extensions["map3d.catalogue"] = workspace().open_catalogue()
    return opened


def close() -> None:
    """Closes the catalogue of the current app."""
    opened: Catalogue | None = current_app.extensions.pop("map3d.catalogue", None)
    if opened is not None:
        opened.close()


def registry_path(rendering: str) -> Path:
    """Returns the registry of the rendering's scene. Raises NotFound."""
    path = workspace().registry_path(catalogue().rendering(check_name(rendering, "rendering")).scene)
    if not path.is_file():
        raise NotFound(f"the scene of rendering {rendering!r} has no objects yet; run: map3d add-files")
    return path


def json_response(data: bytes) -> Response:
    """Returns the document with an ETag that clients revalidate on each request; compressed if the client accepts it."""
    response = Response(data, mimetype="application/json")
    response.set_etag(sha256(data).hexdigest()[:32], weak=True)
    response.headers["Cache-Control"] = "no-cache"
    response.make_conditional(request)
    return compress(response)


@lru_cache(maxsize=4)
def _search_bytes(path: Path, _state: FileState) -> bytes:
    with Registry(path) as objects:
        return dump_document(objects.search())


@lru_cache(maxsize=4)
def _index_bytes(path: Path, _state: FileState) -> bytes:
    with Registry(path) as objects:
        return dump_document(objects.attribute_index())


@lru_cache(maxsize=4)
def _column_bytes(path: Path, column: str, _state: FileState) -> bytes | None:
    with Registry(path) as objects:
        found = objects.column(column)
    return None if found is None else dump_document(found)


def _file_state(path: Path) -> FileState:
    """Returns a value that differs after each change of the registry."""
    log = path.with_name(path.name + "-wal")
    return tuple((stat.st_ino, stat.st_mtime_ns, stat.st_size) for stat in (one.stat() for one in (path, log) if one.is_file()) if stat.st_size)
