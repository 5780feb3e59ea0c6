"""Checks a block before it is committed."""

from collections.abc import Sequence

from map3d.errors import Corrupt
from map3d.tiles.naming import block_of, parent
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, TileId


def check_rendered(shape: StoreShape, block: BlockId, tiles: Sequence[StoredTile], seam: bytes | None) -> None:
    """Raises Corrupt unless every tile has all layers and its parent up to the root, and there is a seam if and only if there are tiles."""
    layers: dict[TileId, set[int]] = {}
    for tile in tiles:
        if not tile.data:
            raise Corrupt(f"block {block}: layer {tile.layer} of tile {tile.z}/{tile.x}/{tile.y} has no bytes")
        layers.setdefault(TileId(tile.z, tile.x, tile.y), set()).add(tile.layer)
    for name, have in layers.items():
        if len(have) != len(shape.layers):
            raise Corrupt(f"block {block}: tile {name.z}/{name.x}/{name.y} has layers {sorted(have)} of {len(shape.layers)}")
        if block_of(name, shape.zmax) != block:
            raise Corrupt(f"block {block}: tile {name.z}/{name.x}/{name.y} belongs to another block")
        above = parent(name)
        if name.z > block.z and above not in layers:
            raise Corrupt(f"block {block}: tile {name.z}/{name.x}/{name.y} has no parent")
    if bool(layers) != (seam is not None):
        raise Corrupt(f"block {block}: {len(layers)} tiles, {'a' if seam is not None else 'no'} seam")
