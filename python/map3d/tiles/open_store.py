"""Opens a tile store from its URL, whatever its type."""

from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

from map3d.errors import BadRequest
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoreShape, TileStore

SQLITE: Final = "sqlite"


def open_store(url: str | Path, *, read_only: bool = False) -> TileStore:
    """Opens an existing store: the path of an SQLite file, or `sqlite:///PATH`. Raises NotFound, BadRequest, UnknownVersion, Corrupt, StoreError."""
    return SqliteTileStore(_sqlite_path(url), read_only=read_only)


def open_or_create_store(url: str | Path, shape: StoreShape) -> TileStore:
    """Opens a store for writing, or creates it. Raises BadRequest if an existing store has a different shape."""
    return SqliteTileStore.open_or_create(_sqlite_path(url), shape)


def _sqlite_path(url: str | Path) -> Path:
    if isinstance(url, Path) or "://" not in url:
        return Path(url)
    parts = urlsplit(url)
    if parts.scheme != SQLITE or parts.netloc:
        raise BadRequest(f"tile store {url}: write the path of an SQLite file, or sqlite:///PATH")
    return Path(unquote(parts.path))
