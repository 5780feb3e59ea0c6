"""The tile stores and the manifest of a rendering: one store per track, as SQLite files in the workspace or under the URL of `create-rendering
--tiles`, where the manifest is, too."""

from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import Final

from map3d.catalogue import RenderingRecord, Track, Workspace
from map3d.errors import NotFound
from map3d.object_store import check_store_url, join_url, open_object_store
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.open_store import open_or_create_store, open_store
from map3d.tiles.tile_store import StoreShape, TileStore

TILES: Final = "tiles"
"""Key of the base URL in `RenderingRecord.options`."""
_DELETING_THREADS: Final = 16
_DELETED_TOGETHER: Final = 1024
_MANIFEST_HEADERS: Final = {"Content-Type": "application/json", "Cache-Control": "no-cache"}


def check_tiles_url(url: str) -> str:
    """Returns a base URL for tiles that can be stored. Raises BadRequest for credentials in it or an unknown scheme, StoreError when the store does
    not answer."""
    checked = check_store_url(url)
    open_object_store(checked).exists(FILE_NAME)
    return checked


def tiles_url(record: RenderingRecord) -> str | None:
    """Returns the URL of a rendering's stores and manifest; None if they are files in the workspace."""
    return join_url(record.options[TILES], record.name) if TILES in record.options else None


def track_url(workspace: Workspace, record: RenderingRecord, track: str) -> str:
    """Returns the URL or path of a track's tile store."""
    base = tiles_url(record)
    return str(workspace.store_path(record.name, track)) if base is None else join_url(base, track)


def open_track(workspace: Workspace, record: RenderingRecord, track: str, *, read_only: bool = True) -> TileStore:
    """Opens the store of a track. Raises NotFound before the first block is rendered."""
    return open_store(track_url(workspace, record, track), read_only=read_only)


def rendering_record(workspace: Workspace, rendering: str) -> RenderingRecord:
    """Reads a rendering's record from the catalogue. Raises NotFound."""
    with workspace.open_catalogue() as catalogue:
        return catalogue.rendering(rendering)


def find_track(workspace: Workspace, record: RenderingRecord, track: str, *, read_only: bool = True) -> TileStore | None:
    """Opens the store of a track; returns None if it does not exist."""
    try:
        return open_track(workspace, record, track, read_only=read_only)
    except NotFound:
        return None


def open_or_create_track(workspace: Workspace, record: RenderingRecord, track: Track) -> TileStore:
    """Opens the store of a track for writing, or creates it. Raises BadRequest if its layers or levels are not those of the rendering."""
    shape = StoreShape(record.tile_px, record.zmax, track.layers)
    return open_or_create_store(track_url(workspace, record, track.id), shape)


def remove_tracks(workspace: Workspace, record: RenderingRecord) -> None:
    """Removes all tile stores of the rendering, including those of views and passes that it no longer has."""
    folder = workspace.rendering_folder(record.name)
    if folder.is_dir():
        for path in folder.glob("*.sqlite*"):
            path.unlink()
    base = tiles_url(record)
    if base is not None:
        remove_objects(base, except_for=FILE_NAME)


def remove_objects(url: str, *, except_for: str | None = None) -> None:
    """Removes all objects below a URL, but not the one named `except_for`; many at a time, since each takes a request."""
    store = open_object_store(url)
    names = (name for name, _ in store.list() if name != except_for)
    with ThreadPoolExecutor(_DELETING_THREADS) as threads:
        while some := list(islice(names, _DELETED_TOGETHER)):
            list(threads.map(store.delete, some))


def read_manifest(workspace: Workspace, record: RenderingRecord) -> bytes | None:
    """Returns the rendering's manifest, None before it is written."""
    base = tiles_url(record)
    if base is not None:
        found = open_object_store(base).get(FILE_NAME)
        return None if found is None else found[0]
    path = workspace.manifest_path(record.name)
    return path.read_bytes() if path.is_file() else None


def share_manifest(record: RenderingRecord, data: bytes) -> None:
    """Stores the manifest beside the tiles if they are outside the workspace."""
    base = tiles_url(record)
    if base is not None:
        open_object_store(base).put(FILE_NAME, data, headers=_MANIFEST_HEADERS)
