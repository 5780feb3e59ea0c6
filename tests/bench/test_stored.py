"""Stores and archives store equal tiles once, and the benchmark reports it."""

from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)

from bench.stored import measure_archive, measure_store

from map3d.publish.pmtiles_archive import write_archive
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer

SAME, OTHER = b"s" * 500, b"o" * 300


@pytest.fixture
def store(tmp_path: Path) -> SqliteTileStore:
    """A store with a block of 1 + 4 + 16 + 64 tiles, all equal except for the root."""
    store = SqliteTileStore.create(tmp_path / "0-45.sqlite", StoreShape(256, 3, (Layer("id", "id", "png", 80),)))
    places = [(z, x, y) for z in range(4) for x in range(1 << z) for y in range(1 << z)]
    tiles = [StoredTile(0, *place, OTHER if place == (0, 0, 0) else SAME) for place in places]
    store.put_block(BlockId(0, 0, 0), "key", 1, tiles, b"seam")
    return store


def test_store_has_equal_tiles_once(store: SqliteTileStore) -> None:
    (row,) = measure_store(store.path)
    assert (row.tiles, row.distinct) == (85, 2)
    assert row.each_bytes == 84 * len(SAME) + len(OTHER)
    assert row.kept_bytes == len(SAME) + len(OTHER)


def test_archive_has_equal_tiles_once_and_runs_as_one_entry(store: SqliteTileStore, tmp_path: Path) -> None:
    write_archive(store, 0, tmp_path / "id.pmtiles", {}, lambda _: None)
    row = measure_archive(tmp_path / "id.pmtiles")
    assert (row.tiles, row.distinct, row.entries) == (85, 2, 2)
    assert row.kept_bytes == len(SAME) + len(OTHER)
