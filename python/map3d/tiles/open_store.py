"""Opens a tile store from its URL, whatever its type."""

from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from map3d.errors import BadRequest
from map3d.tiles.object_tile_store import ObjectTileStore
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoreShape, TileStore

SQLITE: Final = "sqlite"


def open_store(url: str | Path, *, read_only: bool = False) -> TileStore:
    """Opens an existing store: the path of an SQLite file, `sqlite:///PATH`, or the URL of a folder or a place in a cloud, as `file:///PATH` and
    `s3://BUCKET/PREFIX`. Raises NotFound, BadRequest, UnknownVersion, Corrupt, StoreError."""
    path = _sqlite_path(url)
    return ObjectTileStore(str(url), read_only=read_only) if path is None else SqliteTileStore(path, read_only=read_only)


def open_or_create_store(url: str | Path, shape: StoreShape) -> TileStore:
    """Opens a store for writing, or creates it. Raises BadRequest if an existing store has a different shape."""
    path = _sqlite_path(url)
    return ObjectTileStore.open_or_create(str(url), shape) if path is None else SqliteTileStore.open_or_create(path, shape)


def _sqlite_path(url: str | Path) -> Path | None:
    """Returns the path of an SQLite store, None for the URL of an object store."""
    if isinstance(url, Path) or "://" not in url:
        return Path(url)
    parts = urlsplit(url)
    if parts.scheme != SQLITE:
        return None
    if parts.netloc:
        raise BadRequest(f"tile store {url}: write the absolute path of the SQLite file, as sqlite:///PATH")
    return Path(unquote(parts.path))
