"""Reads the stores and manifests of the town's two renderings."""

from contextlib import closing

from map3d.catalogue import RenderingRecord, Workspace
from map3d.tiles.manifest import Manifest
from map3d.tiles.naming import block_of, tiles_of_block
from map3d.tiles.tile_store import StoredTile
from map3d.tiles.track_stores import open_track
from map3d.types import TileId

VIEW = "35-40"
RES_M = "0.2"
KINDS = ("normal", "id", "depth")


def record_of(workspace: Workspace, rendering: str) -> RenderingRecord:
    with closing(workspace.open_catalogue()) as catalogue:
        return catalogue.rendering(rendering)


def manifest_of(workspace: Workspace, rendering: str) -> Manifest:
    return Manifest.load(workspace.manifest_path(rendering).read_bytes())


def stored_tiles(workspace: Workspace, rendering: str, layer: str, track: str = VIEW) -> dict[TileId, bytes]:
    """Returns the tiles of a layer as they are stored."""
    with open_track(workspace, record_of(workspace, rendering), track) as store:
        number = store.shape.layer_number(layer)
        return {tile: store.get_tile(number, *tile) or b"" for tile in store.list_tiles(number)}


def damage(workspace: Workspace, rendering: str, layer: str, data: bytes, damaged: TileId | None = None) -> TileId:
    """Replaces a tile in the store of the first pass, by default one of the deepest level; returns it."""
    record = record_of(workspace, rendering)
    with open_track(workspace, record, VIEW, read_only=False) as store:
        number = store.shape.layer_number(layer)
        damaged = damaged or next(tile for tile in store.list_tiles(number) if tile.z == record.zmax)
        root = block_of(damaged, record.zmax)
        block = store.get_block(root)
        assert block is not None
        tiles = [
            StoredTile(layer_number, *tile, data if (layer_number, tile) == (number, damaged) else found)
            for layer_number in range(len(store.shape.layers))
            for tile in tiles_of_block(root, record.zmax)
            if (found := store.get_tile(layer_number, *tile)) is not None
        ]
        store.put_block(root, block.key, block.version, tiles, store.get_seam(root), fence=1 << 60)
    return damaged
