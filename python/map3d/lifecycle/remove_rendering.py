"""`map3d remove-rendering`: removes a rendering with its tiles. A killed removal is completed by its repetition, or before a rendering of the same
name is created.

The mark states where the tiles are. The record goes before the tiles, so that whatever the catalogue lists is whole.
"""

from contextlib import suppress
from dataclasses import dataclass

from map3d.catalogue import Catalogue, Workspace
from map3d.errors import NotFound
from map3d.ingest.asset_removal import remove_folder
from map3d.lifecycle.removal_checks import check_idle, folder_bytes, objects_bytes
from map3d.lifecycle.removal_mark import read_mark, removal_mark
from map3d.object_store import file_path, open_object_store
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.track_stores import TILES, remove_objects, tiles_url


@dataclass(frozen=True)
class RenderingRemoval:
    """`tiles`: URL of the tiles in an object store, None for tiles in the workspace; `bytes`: of all tiles; `scene`: None when only the remains of a
    removal that was killed are left."""

    name: str
    scene: str | None
    tiles: str | None
    bytes: int


def find_rendering(workspace: Workspace, catalogue: Catalogue, name: str) -> RenderingRemoval:
    """Raises NotFound, or BadRequest while the rendering is being rendered."""
    try:
        record = catalogue.rendering(name)
    except NotFound:
        mark = read_mark(workspace.rendering_folder(name))
        if mark is None:
            raise
        scene, tiles = None, mark.get(TILES)
    else:
        check_idle(catalogue, name)
        scene, tiles = record.scene, tiles_url(record)
    size = folder_bytes(workspace.rendering_folder(name)) + (0 if tiles is None else objects_bytes(tiles))
    return RenderingRemoval(name, scene, tiles, size)


def remove_rendering(workspace: Workspace, catalogue: Catalogue, removal: RenderingRemoval) -> None:
    """Removes record, jobs and tiles. Raises BadRequest while the rendering is being rendered or removed; StoreError."""
    if removal.scene is not None:
        check_idle(catalogue, removal.name)
    with removal_mark(workspace.rendering_folder(removal.name), {TILES: removal.tiles}):
        with suppress(NotFound):
            catalogue.remove_rendering(removal.name)
        _remove_tiles(workspace, removal.name, removal.tiles)


def finish_rendering_removal(workspace: Workspace, name: str) -> None:
    """Removes the tiles that a killed removal left of a rendering that is no longer in the catalogue."""
    folder = workspace.rendering_folder(name)
    mark = read_mark(folder)
    if mark is not None:
        with removal_mark(folder, mark):
            _remove_tiles(workspace, name, mark.get(TILES))


def is_rendering_removed(workspace: Workspace, name: str) -> bool:
    """Whether a removal of the rendering has begun and not finished."""
    return read_mark(workspace.rendering_folder(name)) is not None


def _remove_tiles(workspace: Workspace, name: str, tiles: str | None) -> None:
    """Removes the manifest first: clients then see no rendering instead of one without tiles."""
    folder = workspace.rendering_folder(name)
    workspace.manifest_path(name).unlink(missing_ok=True)
    remove_folder(folder)
    if tiles is None:
        return
    if tiles.startswith("file:"):
        remove_folder(file_path(tiles))
        return
    open_object_store(tiles).delete(FILE_NAME)
    remove_objects(tiles)
