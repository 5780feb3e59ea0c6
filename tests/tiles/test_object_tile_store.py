"""What only a tile store in an object store can do wrong: races between nodes, caches of indexes, cut objects."""

import json

import pytest

from map3d.errors import Corrupt, StaleFence, UnknownVersion
from map3d.object_store import open_object_store
from map3d.tiles.block_object import START_BYTES, check_object, encode_block
from map3d.tiles.naming import tiles_of_block
from map3d.tiles.object_tile_store import CACHED_INDEXES, ObjectTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer

LAYERS = tuple(Layer(f"layer{n}", "id", "png") for n in range(12))
SHAPE = StoreShape(tile_px=256, zmax=4, layers=LAYERS)
BLOCK = BlockId(1, 1, 0)
OBJECT = "blocks/1/1/0.m3b"


@pytest.fixture
def store(store_url: str) -> ObjectTileStore:
    return ObjectTileStore.create(store_url, SHAPE)


def content(salt: str = "", layers: int = 12) -> list[StoredTile]:
    return [StoredTile(n, *tile, f"{salt}{n}:{tile}".encode()) for n in range(layers) for tile in tiles_of_block(BLOCK, SHAPE.zmax)]


def test_an_index_longer_than_the_first_read_is_read_whole(store: ObjectTileStore, store_url: str) -> None:
    tiles = content()
    store.put_block(BLOCK, "k", 1, tiles, b"seam")
    found = open_object_store(store_url).get(OBJECT)
    assert found is not None
    assert check_object(found[0], "").body > START_BYTES
    fresh = ObjectTileStore(store_url, read_only=True)
    assert fresh.get_seam(BLOCK) == b"seam"
    assert [fresh.get_tile(*tile[:4]) for tile in tiles[::50]] == [tile.data for tile in tiles[::50]]
    assert len(list(fresh.list_tiles(11))) == len(tiles) // 12


def test_readers_with_a_cached_index_see_replaced_tiles(store: ObjectTileStore, store_url: str) -> None:
    reader = ObjectTileStore(store_url, read_only=True)
    first, second = content("a", 1), content("b", 1)[:3]
    store.put_block(BLOCK, "k", 1, first, b"one")
    assert reader.get_tile(*first[0][:4]) == first[0].data
    store.put_block(BLOCK, "k", 2, second, None)
    assert reader.get_tile(*first[0][:4]) == second[0].data
    assert reader.get_tile(*first[-1][:4]) is None
    assert reader.get_seam(BLOCK) is None
    store.put_block(BLOCK, "k", 3, first, b"three")
    assert reader.get_tile(*first[-1][:4]) == first[-1].data
    store.remove_block(BLOCK)
    assert reader.get_tile(*first[0][:4]) is None
    assert reader.get_block(BLOCK) is None


@pytest.mark.parametrize("layers", [1, 12])
def test_a_block_that_is_replaced_before_each_part_is_read_is_read_whole(
    layers: int, store: ObjectTileStore, store_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With 12 layers the index, too, needs a second request."""
    versions = iter(range(2, 1000))
    store.put_block(BLOCK, "1", 1, content("1/", layers), b"1")
    reader = ObjectTileStore(store_url, read_only=True)
    get_range = reader._objects.get_range

    def replaced(*given: object, **options: object) -> bytes | None:
        version = next(versions)
        store.put_block(BLOCK, str(version), version, content(f"{version}/", layers), str(version).encode())
        return get_range(*given, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(reader._objects, "get_range", replaced)
    for tile in content("", layers)[::200]:
        before = next(versions)
        found = reader.get_tile(*tile[:4])
        assert found is not None
        version, rest = found.split(b"/", 1)
        assert rest == tile.data
        assert before < int(version) < next(versions)
    assert int(reader.get_seam(BLOCK) or b"0") == next(versions) - 1


def test_an_older_fence_never_overwrites_what_was_written_after_it_looked(store_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A suspended worker has read the old block; meanwhile another one writes with a newer fence."""
    slow, quick = ObjectTileStore.create(store_url, SHAPE), ObjectTileStore(store_url)
    slow.put_block(BLOCK, "k0", 1, content("zero", 1), None, fence=1)
    put = slow._objects.put

    def overtaken(*given: object, **options: object) -> str:
        monkeypatch.setattr(slow._objects, "put", put)
        quick.put_block(BLOCK, "k2", 3, content("new", 1), b"new", fence=3)
        return put(*given, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(slow._objects, "put", overtaken)
    with pytest.raises(StaleFence, match=r"fence 2.*fence 3"):
        slow.put_block(BLOCK, "k1", 2, content("old", 1), b"old", fence=2)
    assert quick.get_seam(BLOCK) == b"new"
    assert ObjectTileStore(store_url).get_block(BLOCK) == quick.get_block(BLOCK)


def test_of_two_first_writers_the_newer_fence_stays(store_url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    slow, quick = ObjectTileStore.create(store_url, SHAPE), ObjectTileStore(store_url)
    put = slow._objects.put

    def overtaken(*given: object, **options: object) -> str:
        monkeypatch.setattr(slow._objects, "put", put)
        quick.put_block(BLOCK, "old", 1, content("old", 1), b"old", fence=1)
        return put(*given, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(slow._objects, "put", overtaken)
    slow.put_block(BLOCK, "new", 2, content("new", 1), b"new", fence=2)
    assert quick.get_seam(BLOCK) == b"new"


def test_a_lost_answer_to_a_write_is_no_failure(store: ObjectTileStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """The write succeeded, but its answer was lost, so the object store writes it again under the same condition."""
    store.put_block(BLOCK, "k", 1, content("a", 1), b"a", fence=1)
    put = store._objects.put

    def twice(*given: object, **options: object) -> str:
        put(*given, **options)  # type: ignore[arg-type]
        return put(*given, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(store._objects, "put", twice)
    assert store.put_block(BLOCK, "k", 2, content("b", 1), b"b", fence=2).version == 2
    assert store.get_seam(BLOCK) == b"b"


def test_equal_tiles_are_stored_once_and_bytes_ignore_their_order() -> None:
    tiles = [StoredTile(0, *tile, bytes(10_000)) for tile in tiles_of_block(BLOCK, SHAPE.zmax)]
    data, index = encode_block(BLOCK, "k", 1, 1, tiles, None)
    assert len(data) == index.body + 10_000
    assert encode_block(BLOCK, "k", 1, 1, tiles[::-1], None)[0] == data


def test_every_changed_or_cut_byte_is_found(store: ObjectTileStore, store_url: str) -> None:
    tiles = content(layers=1)[:2]
    store.put_block(BLOCK, "k", 1, tiles, b"seam")
    assert store.check() == []
    objects = open_object_store(store_url)
    found = objects.get(OBJECT)
    assert found is not None
    data = found[0]
    for place in range(0, len(data), 7):
        with pytest.raises((Corrupt, UnknownVersion)):
            check_object(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :], "")
        with pytest.raises(Corrupt):
            check_object(data[:place], "")
    objects.put(OBJECT, data[:-1] + b"?")
    assert len(store.check()) == 1
    with pytest.raises(Corrupt, match="does not match its hash"):
        store.get_seam(BLOCK)
    assert store.get_tile(*tiles[0][:4]) == tiles[0].data
    objects.put("blocks/1/0/0.m3b", data)
    assert any("contains block 1/1/0" in fault.text for fault in store.check())


def test_a_newer_format_is_refused(store: ObjectTileStore, store_url: str) -> None:
    objects = open_object_store(store_url)
    found = objects.get("store.json")
    assert found is not None
    objects.put("store.json", json.dumps({**json.loads(found[0]), "version": 2}).encode())
    assert not store.is_current()
    with pytest.raises(UnknownVersion):
        ObjectTileStore(store_url)
    objects.put("store.json", b"{}")
    with pytest.raises(Corrupt):
        ObjectTileStore(store_url)


def test_foreign_objects_are_ignored(store: ObjectTileStore, store_url: str) -> None:
    objects = open_object_store(store_url)
    for name in ("blocks/README.txt", "blocks/1/x/0.m3b", "blocks/01/1/0.m3b", "rendering.json"):
        objects.put(name, b"x")
    assert store.list_blocks() == []


def test_the_cache_of_indexes_is_bounded(store: ObjectTileStore, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("map3d.tiles.object_tile_store.CACHED_INDEXES", 2)
    for x in (0, 1):
        for y in (0, 1):
            store.put_block(BlockId(1, x, y), "k", 1, [], None)
    assert len(store._indexes) == 2
    assert CACHED_INDEXES > 100
