"""The stored tiles and seams of a rendering, for comparisons."""

from map3d.catalogue import Workspace
from map3d.tiles.sqlite_store import SqliteTileStore


def stored(workspace: Workspace, rendering: str = "r") -> dict[object, object]:
    """Returns (track, layer, tile) → bytes and (track, block) → seam."""
    found: dict[object, object] = {}
    for path in workspace.rendering_folder(rendering).glob("*.sqlite"):
        with SqliteTileStore(path, read_only=True) as store:
            for layer in range(len(store.shape.layers)):
                found.update({(path.stem, layer, tile): store.get_tile(layer, *tile) for tile in store.list_tiles(layer)})
            found.update({(path.stem, block.id): store.get_seam(block.id) for block in store.list_blocks()})
    return found
