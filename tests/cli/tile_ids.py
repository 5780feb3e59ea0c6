"""Object ids in the tiles of a rendering."""

import numpy as np
import pytest

from map3d.catalogue import Workspace
from map3d.tiles.sqlite_store import SqliteTileStore

core = pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)


def ids_in_tiles(workspace: Workspace) -> set[int]:
    """Returns the object ids in the deepest data tiles of the view 0-45 of the rendering `view`."""
    seen: set[int] = set()
    with SqliteTileStore(workspace.store_path("view", "0-45"), read_only=True) as store:
        number = [layer.kind for layer in store.shape.layers].index("data")
        for tile in store.list_tiles(number):
            data = store.get_tile(number, *tile) if tile.z == store.shape.zmax else None
            if data is not None:
                seen |= set(np.unique(core.decode_data_tile(data)["id"]).tolist())
    return seen
