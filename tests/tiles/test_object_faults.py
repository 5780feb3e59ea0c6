"""An object store of which a share of the requests fails, is slow, or loses its answers: the tiles are right all the same."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from map3d.errors import StaleFence, StoreError
from map3d.object_store import open_object_store
from map3d.tiles.naming import tiles_of_block
from map3d.tiles.object_tile_store import ObjectTileStore
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer
from tests.faulty_s3 import FAULTS, faulty_proxy
from tests.object_servers import environment, new_prefix, s3_environment

SHAPE = StoreShape(tile_px=256, zmax=5, layers=(Layer("color", "color", "webp", 80), Layer("id", "id", "png")))
BLOCKS = [BlockId(2, x, y) for x in range(4) for y in range(4)]
SHARE = 0.05


def content(block: BlockId, salt: int) -> list[StoredTile]:
    return [StoredTile(layer, *tile, f"{salt} {layer} {tile}".encode() * 20) for layer in (0, 1) for tile in tiles_of_block(block, SHAPE.zmax)]


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.endurance)])
def test_tiles_are_right_whatever_happens_to_requests(s3_endpoint: str, tmp_path: Path, seed: int) -> None:
    with faulty_proxy(s3_endpoint, seed, SHARE) as (endpoint, counts), environment(s3_environment(endpoint)):
        url = new_prefix()
        store = ObjectTileStore.open_or_create(url, SHAPE)

        def write(block: BlockId) -> None:
            for fence in (1, 2, 3):
                stored = store.put_block(block, f"key {fence}", fence, content(block, fence // 2), b"seam" * 1000, fence=fence)
                assert stored.version == (1 if fence == 1 else 2), "equal tiles keep their version"
            with pytest.raises(StaleFence):
                store.put_block(block, "old", 9, content(block, 9), None, fence=2)

        with ThreadPoolExecutor(4) as pool:
            list(pool.map(write, BLOCKS))
        with SqliteTileStore.create(tmp_path / "right.sqlite", SHAPE) as right, ObjectTileStore(url, read_only=True) as reader:
            for block in BLOCKS:
                right.put_block(block, "key 3", 2, content(block, 1), b"seam" * 1000, fence=3)
            assert reader.list_blocks() == right.list_blocks()
            assert reader.check() == []
            for layer in (0, 1):
                assert reader.layer_digest(layer) == right.layer_digest(layer)
                tiles = list(right.list_tiles(layer))[::31]
                assert [reader.get_tile(layer, *tile) for tile in tiles] == [right.get_tile(layer, *tile) for tile in tiles]
            assert reader.get_seams(BLOCKS) == right.get_seams(BLOCKS)
        assert all(counts[fault] for fault in FAULTS), f"every fault has happened: {counts}"


@pytest.mark.parametrize("header", ["If-None-Match", "If-Match"])
def test_a_store_that_ignores_the_conditions_of_writes_is_refused(s3_endpoint: str, header: str) -> None:
    with faulty_proxy(s3_endpoint, 1, 0.0, header.lower()) as (endpoint, _), environment(s3_environment(endpoint)):
        url = new_prefix()
        with pytest.raises(StoreError, match=f"ignores the condition {header} of writes"):
            ObjectTileStore.open_or_create(url, SHAPE)
        assert list(open_object_store(url).list()) == []


def test_the_probe_of_conditions_leaves_nothing(s3_url: str) -> None:
    ObjectTileStore.create(s3_url, SHAPE)
    assert [name for name, _ in open_object_store(s3_url).list()] == ["store.json"]
