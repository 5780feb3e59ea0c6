"""The tile stores of a rendering, one per track: SQLite files in the workspace."""

from map3d.catalogue import RenderingRecord, Track, Workspace
from map3d.errors import NotFound
from map3d.tiles.open_store import open_or_create_store, open_store
from map3d.tiles.tile_store import StoreShape, TileStore


def track_url(workspace: Workspace, record: RenderingRecord, track: str) -> str:
    """Returns the URL or path of a track's tile store."""
    return str(workspace.store_path(record.name, track))


def open_track(workspace: Workspace, record: RenderingRecord, track: str, *, read_only: bool = True) -> TileStore:
    """Opens the store of a track. Raises NotFound before the first block is rendered."""
    return open_store(track_url(workspace, record, track), read_only=read_only)


def rendering_record(workspace: Workspace, rendering: str) -> RenderingRecord:
    """Reads a rendering's record from the catalogue. Raises NotFound."""
    catalogue = workspace.open_catalogue()
    try:
        return catalogue.rendering(rendering)
    finally:
        catalogue.close()


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
