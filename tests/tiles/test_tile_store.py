"""The tests that every implementation of a tile store passes."""

import multiprocessing
import threading
from pathlib import Path

import pytest

from map3d.errors import AlreadyExists, BadRequest, NotFound, StaleFence
from map3d.tiles.naming import tiles_of_block
from map3d.tiles.object_tile_store import ObjectTileStore
from map3d.tiles.open_store import open_or_create_store, open_store
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredBlock, StoredTile, StoreShape
from map3d.types import BlockId, Layer, TileId

LAYERS = (Layer("color", "color", "webp", 80), Layer("normal", "normal", "png"), Layer("id", "id", "png"), Layer("depth", "depth", "png"))
SHAPE = StoreShape(tile_px=256, zmax=4, layers=LAYERS)
BLOCK = BlockId(1, 1, 0)


@pytest.fixture(params=["sqlite", "file", "s3"])
def path(request, tmp_path):
    """The path or URL of a store of each type."""
    if request.param == "s3":
        return request.getfixturevalue("s3_url") + "/0-45"
    return tmp_path / "0-45.store" if request.param == "sqlite" else (tmp_path / "0-45").as_uri()


@pytest.fixture
def store_class(path):
    return SqliteTileStore if isinstance(path, Path) else ObjectTileStore


@pytest.fixture
def store(store_class, path):
    with store_class.create(path, SHAPE) as made:
        yield made


def content(block, salt="", layers=range(4)):
    return [StoredTile(n, *tile, f"{salt}{n}:{tile}".encode()) for n in layers for tile in tiles_of_block(block, SHAPE.zmax)]


def read(store, tiles):
    return [store.get_tile(*tile[:4]) for tile in tiles]


def test_a_new_store_is_empty(store):
    assert store.list_blocks() == []
    assert list(store.list_tiles(0)) == []
    assert store.get_tile(0, 0, 0, 0) is None
    assert store.get_seam(BLOCK) is None
    assert store.get_block(BLOCK) is None


def test_stored_tiles_read_back(store):
    tiles = content(BLOCK)
    assert store.put_block(BLOCK, "key", 1, tiles, b"seam") == StoredBlock(BLOCK, "key", 1, len(tiles))
    assert read(store, tiles) == [tile.data for tile in tiles]
    assert store.get_seam(BLOCK) == b"seam"
    assert store.get_block(BLOCK) == StoredBlock(BLOCK, "key", 1, len(tiles))


def test_many_tiles_are_read_in_their_order(store):
    blocks = [BlockId(0, 0, 0), BLOCK, BlockId(1, 0, 1)]
    for block in blocks:
        store.put_block(block, "k", 1, content(block)[::3], b"s")
    names = [tile for block in blocks for tile in tiles_of_block(block, SHAPE.zmax)] + [TileId(4, 0, 0), TileId(4, 8, 0)]
    for order in (names, names[::-1], sorted(names, key=lambda tile: tile.x * 7 % 5), []):
        for layer in (0, 3):
            assert list(store.read_tiles(layer, order)) == [store.get_tile(layer, *tile) for tile in order]


def test_seams_are_read_together(store):
    blocks = [BlockId(1, x, y) for x in (0, 1) for y in (0, 1)]
    for block in blocks[:2]:
        store.put_block(block, "k", 1, content(block), str(block).encode())
    store.put_block(blocks[2], "k", 1, [], None)
    assert store.get_seams(blocks) == {block: str(block).encode() for block in blocks[:2]}
    assert store.get_seams([]) == {}


def test_missing_tiles_are_none(store):
    store.put_block(BLOCK, "key", 1, content(BLOCK, layers=[0]), b"seam")
    assert store.get_tile(1, 1, 1, 0) is None
    assert store.get_tile(0, 1, 0, 0) is None


def test_a_block_without_content_is_known(store):
    store.put_block(BLOCK, "key", 1, [], None)
    assert store.get_block(BLOCK) == StoredBlock(BLOCK, "key", 1, 0)
    assert store.get_seam(BLOCK) is None


def test_replacing_a_block_removes_its_old_tiles(store):
    other = BlockId(1, 0, 0)
    store.put_block(other, "k", 1, content(other), b"s")
    store.put_block(BLOCK, "old", 1, content(BLOCK), b"old")
    new = content(BLOCK, "new")[:5]
    store.put_block(BLOCK, "new", 2, new, b"new")
    assert read(store, content(BLOCK)) == [tile.data for tile in new] + [None] * (len(content(BLOCK)) - 5)
    assert read(store, content(other)) == [tile.data for tile in content(other)]
    assert store.get_block(BLOCK) == StoredBlock(BLOCK, "new", 2, 5)
    assert len(list(store.list_tiles(0))) == len(content(other, layers=[0])) + 5


def test_equal_blocks_keep_their_version(store):
    tiles = content(BLOCK)
    store.put_block(BLOCK, "a", 1, tiles, b"seam")
    assert store.put_block(BLOCK, "b", 2, list(reversed(tiles)), b"seam").version == 1
    assert store.get_block(BLOCK).key == "b"
    assert store.put_block(BLOCK, "c", 3, tiles, b"other seam").version == 3
    assert store.put_block(BLOCK, "c", 4, tiles[1:], b"other seam").version == 4


def test_layer_digest_depends_on_tiles_alone(store):
    other = BlockId(1, 0, 0)
    store.put_block(BLOCK, "a", 1, content(BLOCK), b"s")
    store.put_block(other, "a", 1, content(other), b"s")
    before = [store.layer_digest(layer) for layer in (0, 1)]
    assert before[0] != before[1]
    store.remove_block(BLOCK)
    assert store.layer_digest(0) != before[0]
    store.put_block(BLOCK, "b", 2, content(BLOCK), b"t")
    assert [store.layer_digest(layer) for layer in (0, 1)] == before


def test_an_older_fence_is_refused(store):
    tiles = content(BLOCK)
    store.put_block(BLOCK, "new", 2, tiles, b"seam", fence=7)
    with pytest.raises(StaleFence, match=r"fence 6.*fence 7"):
        store.put_block(BLOCK, "old", 1, content(BLOCK, "old"), b"old", fence=6)
    assert read(store, tiles) == [tile.data for tile in tiles]
    assert store.get_block(BLOCK) == StoredBlock(BLOCK, "new", 2, len(tiles))
    store.put_block(BLOCK, "again", 2, tiles, b"seam", fence=7)
    store.put_block(BlockId(1, 0, 0), "other", 1, [], None, fence=1)


def test_removing_a_block_keeps_equal_tiles_of_other_blocks(store):
    other = BlockId(1, 0, 0)
    one, two = StoredTile(0, 1, 1, 0, b"same"), StoredTile(0, 1, 0, 0, b"same")
    store.put_block(BLOCK, "k", 1, [one], b"s")
    store.put_block(other, "k", 1, [two], b"s")
    store.put_block(BLOCK, "k", 2, [], None)
    assert read(store, [one, two]) == [None, b"same"]


def test_a_removed_block_is_gone(store):
    store.put_block(BLOCK, "k", 1, content(BLOCK), b"s")
    assert store.remove_block(BLOCK)
    assert not store.remove_block(BLOCK)
    assert store.list_blocks() == []
    assert list(store.list_tiles(0)) == []


def test_blocks_are_listed_deepest_first_in_morton_order(store):
    ids = [BlockId(0, 0, 0), BlockId(1, 1, 1), BlockId(1, 0, 1), BlockId(1, 1, 0), BlockId(1, 0, 0)]
    for block in ids:
        store.put_block(block, "k", 1, content(block), b"s")
    assert [block.id for block in store.list_blocks()] == [(1, 0, 0), (1, 1, 0), (1, 0, 1), (1, 1, 1), (0, 0, 0)]
    assert list(store.list_tiles(2)) == sorted(tile[1:4] for block in ids for tile in content(block, layers=[2]))


def test_tile_positions_of_a_level_are_those_of_its_tiles(store):
    assert store.list_tile_positions(store.shape.zmax) == []
    for block in (BlockId(1, 1, 1), BlockId(1, 0, 1), BlockId(0, 0, 0)):
        store.put_block(block, "k", 1, content(block), b"s")
    for z in range(store.shape.zmax + 1):
        assert sorted(store.list_tile_positions(z)) == sorted((tile.x, tile.y) for tile in store.list_tiles(0) if tile.z == z)


@pytest.mark.parametrize(
    ("block", "version", "tiles"),
    [
        (BLOCK, 1, [StoredTile(0, 1, 0, 0, b"another block's")]),
        (BLOCK, 1, [StoredTile(0, 0, 0, 0, b"of the level above")]),
        (BLOCK, 1, [StoredTile(0, 5, 16, 0, b"below zmax")]),
        (BLOCK, 1, [StoredTile(0, 1, 2, 0, b"cannot exist")]),
        (BLOCK, 1, [StoredTile(4, 1, 1, 0, b"no such layer")]),
        (BLOCK, 1, [StoredTile(-1, 1, 1, 0, b"no such layer")]),
        (BLOCK, 1, [StoredTile(0, 1, 1, 0, b"")]),
        (BLOCK, 1, [StoredTile(0, 1, 1, 0, b"twice"), StoredTile(0, 1, 1, 0, b"twice")]),
        (BLOCK, 0, []),
        (BlockId(2, 0, 0), 1, []),
    ],
)
def test_blocks_with_invalid_tiles_are_refused(store, block, version, tiles):
    store.put_block(BLOCK, "k", 1, content(BLOCK), b"s")
    with pytest.raises(BadRequest):
        store.put_block(block, "bad", version, tiles, b"bad")
    assert read(store, content(BLOCK)) == [tile.data for tile in content(BLOCK)]


def test_shape_and_tiles_survive_reopening(store_class, path, store):
    store.put_block(BLOCK, "k", 7, content(BLOCK), b"s")
    for again in (store_class(path), store_class(path, read_only=True), store_class.open_or_create(path, SHAPE)):
        with again:
            assert again.shape == SHAPE
            assert read(again, content(BLOCK)) == [tile.data for tile in content(BLOCK)]


def test_creating_a_store_twice_or_with_another_shape_fails(store_class, path, store):
    with pytest.raises(AlreadyExists):
        store_class.create(path, SHAPE)
    with pytest.raises(BadRequest, match="--regrid"):
        store_class.open_or_create(path, StoreShape(512, 4, LAYERS))


def test_an_absent_store_is_not_found(store_class, path):
    for open_it in (store_class, open_store):
        with pytest.raises(NotFound):
            open_it(path)
    with pytest.raises(NotFound):
        store_class(path)


def test_a_url_opens_the_store(path):
    with open_or_create_store(path, SHAPE) as made:
        made.put_block(BLOCK, "k", 1, content(BLOCK), b"s")
        assert made.is_current()
        for again in (open_store(path), open_store(path, read_only=True), open_or_create_store(path, SHAPE), open_store(made.url)):
            with again:
                assert type(again) is type(made)
                assert read(again, content(BLOCK)) == [tile.data for tile in content(BLOCK)]
                assert again.check() == []


def test_stores_of_equal_tiles_have_equal_digests(store, tmp_path):
    with SqliteTileStore.create(tmp_path / "other.sqlite", SHAPE) as other:
        for block in (BlockId(0, 0, 0), BLOCK, BlockId(1, 0, 1)):
            store.put_block(block, "k", 1, content(block), b"s")
            other.put_block(block, "another key", 2, list(reversed(content(block))), b"another seam")
        assert [store.layer_digest(layer) for layer in range(4)] == [other.layer_digest(layer) for layer in range(4)]


def test_a_read_only_store_refuses_writes(store_class, path, store):
    with store_class(path, read_only=True) as reader, pytest.raises(BadRequest, match="reading only"):
        reader.put_block(BLOCK, "k", 1, [], None)


def test_a_closed_store_can_be_used_again(store):
    store.put_block(BLOCK, "k", 1, content(BLOCK), b"s")
    store.close()
    assert store.get_seam(BLOCK) == b"s"


def _write_versions(store_class, path, rounds):
    with store_class(path) as store:
        for version in range(1, rounds + 1):
            store.put_block(BLOCK, str(version), version, content(BLOCK, f"{version}/"), str(version).encode())


def test_readers_see_complete_blocks_while_a_writer_runs(store_class, path, store):
    store.put_block(BLOCK, "0", 1, content(BLOCK, "1/"), b"1")
    writer = multiprocessing.get_context("spawn").Process(target=_write_versions, args=(store_class, path, 25))
    writer.start()
    probes = [tile[:4] for tile in content(BLOCK)[::37]]
    with store_class(path, read_only=True) as reader:
        while writer.is_alive():
            before = int(reader.get_seam(BLOCK))
            versions = {int(reader.get_tile(*probe).split(b"/")[0]) for probe in probes}
            after = int(reader.get_seam(BLOCK))
            assert versions <= set(range(before, after + 1))
    writer.join()
    assert writer.exitcode == 0
    assert store.get_seam(BLOCK) == b"25"


def test_concurrent_writers_lose_nothing(store_class, path, store):
    spawn = multiprocessing.get_context("spawn")
    blocks = [BlockId(1, x, y) for x in (0, 1) for y in (0, 1)]
    writers = [spawn.Process(target=_write_one, args=(store_class, path, block)) for block in blocks]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert [writer.exitcode for writer in writers] == [0] * 4
    for block in blocks:
        assert read(store, content(block)) == [tile.data for tile in content(block)]


def _write_one(store_class, path, block):
    with store_class(path) as store:
        store.put_block(block, "k", 1, content(block), b"s")


def test_threads_share_a_store(store):
    tiles = content(BLOCK)
    store.put_block(BLOCK, "k", 1, tiles, b"s")
    wrong = []

    def read_all():
        wrong.extend(tile for tile in tiles if store.get_tile(*tile[:4]) != tile.data)

    threads = [threading.Thread(target=read_all) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
