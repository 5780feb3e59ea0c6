"""`map3d verify --sample` and `--deep` find stored images that a new render would not give."""

from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from map3d.tiles.naming import block_levels, tiles_of_block
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile
from tests.cli.towns import Run, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole


def swap_two_images(path: Path) -> None:
    """Exchanges two images of one base block: every image stays valid."""
    with SqliteTileStore(path) as store:
        zmax = store.shape.zmax
        block = next(block for block in store.list_blocks() if block.id.z == block_levels(zmax)[0].root and block.tiles)
        tiles = [
            StoredTile(layer, *tile, data)
            for layer in range(len(store.shape.layers))
            for tile in tiles_of_block(block.id, zmax)
            if (data := store.get_tile(layer, *tile)) is not None
        ]
        first, second = [n for n, tile in enumerate(tiles) if tile.layer == 0 and tile.z == zmax][:2]
        assert tiles[first].data != tiles[second].data
        tiles[first], tiles[second] = tiles[first]._replace(data=tiles[second].data), tiles[second]._replace(data=tiles[first].data)
        seam = store.get_seam(block.id)
        store.put_block(block.id, block.key, block.version, tiles, seam, fence=2**40)
    with SqliteTileStore(path) as store:
        assert store.get_block(block.id) == block


def test_stored_images_that_differ_from_a_new_render_are_found(run: Run, tmp_path: Path) -> None:
    assert run("create-scene", "town")[0] == 0
    assert run("add-files", "town", str(write_town(tmp_path / "files", 2)))[0] == 0
    assert run("create-rendering", "town", "view", "--res", "0.1", "--view", "0/45")[0] == 0
    assert run("render", "view")[0] == 0
    assert run("verify", "view", "--deep")[0] == 0
    status, out, err = run("verify", "view", "--sample", "1")
    assert (status, "1 blocks rendered again" in out, "seed" in err) == (0, True, True)
    swap_two_images(Workspace(tmp_path / "workspace").store_path("view", "0-45"))
    assert run("verify", "view")[0] == 0
    for options in (("--deep",), ("--sample", "1000", "--seed", "5")):
        status, out, _ = run("verify", "view", *options)
        assert status == 1
        assert "2 images or seams differ from those of a new render" in out
