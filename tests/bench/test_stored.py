"""What is saved by keeping equal tiles once: the store and the archive share them, and the figures say so."""

from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from bench.stored import of_archive, of_store

from map3d.publish.pmtiles_archive import write_archive
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer

SAME, OTHER = b"s" * 500, b"o" * 300


@pytest.fixture
def store(tmp_path: Path) -> SqliteTileStore:
    """A block of 1 + 4 + 16 + 64 tiles, all but the root equal."""
    made = SqliteTileStore.create(tmp_path / "0-45.sqlite", StoreShape(256, 3, (Layer("id", "id", "png", 80),)))
    places = [(z, x, y) for z in range(4) for x in range(1 << z) for y in range(1 << z)]
    tiles = [StoredTile(0, *place, OTHER if place == (0, 0, 0) else SAME) for place in places]
    made.put_block(BlockId(0, 0, 0), "key", 1, tiles, b"seam")
    return made


def test_a_store_keeps_equal_tiles_once(store: SqliteTileStore) -> None:
    (row,) = of_store(store.path)
    assert (row.tiles, row.distinct) == (85, 2)
    assert row.each_bytes == 84 * len(SAME) + len(OTHER)
    assert row.kept_bytes == len(SAME) + len(OTHER)


def test_an_archive_keeps_equal_tiles_once_and_runs_of_them_as_one_entry(store: SqliteTileStore, tmp_path: Path) -> None:
    write_archive(store, 0, tmp_path / "id.pmtiles", {}, lambda _: None)
    row = of_archive(tmp_path / "id.pmtiles")
    assert (row.tiles, row.distinct, row.entries) == (85, 2, 2)
    assert row.kept_bytes == len(SAME) + len(OTHER)
