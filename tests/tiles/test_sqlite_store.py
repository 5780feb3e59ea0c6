"""Guarantees that only the SQLite store gives."""

import os
import signal
import sqlite3
import subprocess
import sys
from dataclasses import replace

import pytest

from map3d.errors import BadRequest, Corrupt, StaleFence, StoreError, UnknownVersion
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import StoredTile, StoreShape
from map3d.types import BlockId, Layer, Sun

SHAPE = StoreShape(256, 0, (Layer("color", "color", "png"),))
BLOCK = BlockId(0, 0, 0)


def tile(data):
    return StoredTile(0, 0, 0, 0, data)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "0-45.sqlite"


@pytest.fixture
def store(path):
    with SqliteTileStore.create(path, SHAPE) as made:
        yield made


def rows(path, query):
    with sqlite3.connect(path) as db:
        found = db.execute(query).fetchall()
    db.close()
    return found


def test_the_file_is_durable_and_concurrent(path, store):
    assert rows(path, "PRAGMA journal_mode") == [("wal",)]
    assert rows(path, "PRAGMA page_size") == [(16384,)]
    assert store._connections.current().execute("PRAGMA synchronous").fetchone() == (2,)


def test_the_tables_are_those_of_the_specification(path, store):
    columns = {name: [row[1] for row in rows(path, f"PRAGMA table_info({name})")] for name in ("blob", "tile", "block", "meta")}
    assert columns["blob"] == ["hash", "bytes"]
    assert columns["tile"] == ["layer", "z", "x", "y", "block", "hash"]
    assert columns["block"] == ["id", "z", "x", "y", "key", "version", "tiles", "seam", "fence"]
    assert columns["meta"] == ["key", "value"]


def test_unused_blobs_are_deleted(path, store):
    store.put_block(BLOCK, "a", 1, [tile(b"old")], b"s")
    store.put_block(BLOCK, "b", 2, [tile(b"new")], b"s")
    assert rows(path, "SELECT bytes FROM blob") == [(b"new",)]


def test_equal_tiles_are_stored_once(tmp_path):
    shape = StoreShape(256, 2, SHAPE.layers)
    path = tmp_path / "dedupe.sqlite"
    with SqliteTileStore.create(path, shape) as store:
        store.put_block(BLOCK, "a", 1, [StoredTile(0, 2, x, y, b"same") for x in range(4) for y in range(4)], b"s")
    assert rows(path, "SELECT count(*) FROM blob") == [(1,)]
    assert rows(path, "SELECT count(*) FROM tile") == [(16,)]


def test_a_failed_put_changes_nothing(store, monkeypatch):
    store.put_block(BLOCK, "a", 1, [tile(b"old")], b"s")

    def fail(*_):
        raise sqlite3.OperationalError("disk I/O error")

    monkeypatch.setattr("map3d.tiles.sqlite_store._insert_tiles", fail)
    with pytest.raises(StoreError, match="disk I/O error"):
        store.put_block(BLOCK, "b", 2, [tile(b"new")], b"t")
    assert store.get_tile(0, 0, 0, 0) == b"old"
    assert store.get_block(BLOCK).key == "a"


def test_a_writer_killed_during_a_put_leaves_the_old_block(path, store):
    store.put_block(BLOCK, "a", 1, [tile(b"old")], b"s")
    script = (
        "import os, sys; from pathlib import Path; import map3d.tiles.sqlite_store as home\n"
        "from map3d.tiles.tile_store import StoredTile; from map3d.types import BlockId\n"
        "home._delete_unused_blobs = lambda *_: os.kill(os.getpid(), 9)\n"
        "home.SqliteTileStore(Path(sys.argv[1])).put_block(BlockId(0, 0, 0), 'b', 2, [StoredTile(0, 0, 0, 0, b'new')], b't')\n"
    )
    done = subprocess.run([sys.executable, "-c", script, str(path)], check=False, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    assert done.returncode == -signal.SIGKILL
    assert store.get_tile(0, 0, 0, 0) == b"old"
    assert store.get_seam(BLOCK) == b"s"
    assert store.check() == []


def test_a_store_in_a_read_only_folder_is_readable(path, store, monkeypatch):
    store.put_block(BLOCK, "a", 1, [tile(b"tile")], b"s")
    store.close()
    before = sorted(path.parent.iterdir())
    monkeypatch.setattr(os, "access", lambda *_: False)
    with SqliteTileStore(path, read_only=True) as reader:
        assert reader.get_tile(0, 0, 0, 0) == b"tile"
        assert sorted(path.parent.iterdir()) == before


def test_a_full_disk_raises_store_error(store):
    store._connections.current().execute("PRAGMA max_page_count = 20")
    with pytest.raises(StoreError, match="full"):
        store.put_block(BLOCK, "a", 1, [tile(bytes(1 << 20))], b"s")
    assert store.get_block(BLOCK) is None


def test_another_version_is_refused_with_both_numbers(path, store):
    with sqlite3.connect(path) as db:
        db.execute("UPDATE meta SET value = '99' WHERE key = 'version'")
    db.close()
    with pytest.raises(UnknownVersion, match=r"99.*2"):
        SqliteTileStore(path)


def downgrade(path):
    with sqlite3.connect(path) as db:
        db.execute("ALTER TABLE block DROP COLUMN fence")
        db.execute("UPDATE meta SET value = '1' WHERE key = 'version'")
    db.close()


def test_a_store_of_version_1_is_migrated_when_opened_for_writing(path, store):
    store.put_block(BLOCK, "a", 1, [tile(b"old")], b"s")
    store.close()
    downgrade(path)
    with SqliteTileStore(path, read_only=True) as reader:
        assert reader.get_tile(0, 0, 0, 0) == b"old"
        assert reader.list_blocks() == [reader.get_block(BLOCK)]
    assert rows(path, "SELECT value FROM meta WHERE key = 'version'") == [("1",)]
    for _ in range(2):
        with SqliteTileStore(path) as writer:
            assert writer.get_tile(0, 0, 0, 0) == b"old"
    with SqliteTileStore(path) as writer:
        writer.put_block(BLOCK, "b", 2, [tile(b"new")], b"s", fence=1)
        with pytest.raises(StaleFence):
            writer.put_block(BLOCK, "a", 1, [tile(b"old")], b"s", fence=0)
    assert rows(path, "SELECT value FROM meta WHERE key = 'version'") == [("2",)]


@pytest.mark.parametrize("data", [b"", b"not a database, but long enough to look like one" * 40])
def test_a_file_that_is_not_a_store_is_corrupt(path, data):
    path.write_bytes(data)
    with pytest.raises((Corrupt, StoreError)):
        SqliteTileStore(path)
    assert path.read_bytes() == data


@pytest.mark.parametrize("value", ["", "{}", '[{"name": "color"}]', '[{"name": "color", "kind": "color", "format": "gif"}]'])
def test_a_store_with_invalid_layers_is_corrupt(path, store, value):
    with sqlite3.connect(path) as db:
        db.execute("UPDATE meta SET value = ? WHERE key = 'layers'", (value,))
    db.close()
    with pytest.raises(Corrupt):
        SqliteTileStore(path).close()


def test_check_finds_changed_and_lost_bytes(path, store):
    store.put_block(BLOCK, "a", 1, [tile(b"tile")], b"s")
    assert store.check() == []
    with sqlite3.connect(path) as db:
        db.execute("UPDATE blob SET bytes = x'00'")
    assert store.check() == [("1 tiles whose bytes do not match their hash", (BlockId(0, 0, 0),))]
    with db:
        db.execute("DELETE FROM blob")
    assert store.check() == [("1 tiles without bytes", (BlockId(0, 0, 0),))]
    with pytest.raises(Corrupt, match="has no bytes"):
        store.get_tile(0, 0, 0, 0)
    with db:
        db.execute("DELETE FROM tile")
    db.close()
    assert store.check() == [("block 0/0/0: expected 1 tiles, found 0", (BlockId(0, 0, 0),))]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_has_its_own_connections(store):
    store.put_block(BLOCK, "a", 1, [tile(b"tile")], b"s")
    mine = store._connections.current()
    child = os.fork()
    if child == 0:
        own = store._connections.current() is not mine and store.get_tile(0, 0, 0, 0) == b"tile"
        os._exit(0 if own else 1)
    assert os.waitpid(child, 0)[1] == 0
    assert store.get_tile(0, 0, 0, 0) == b"tile"


def test_layers_read_back_with_all_their_properties(tmp_path):
    sun = Sun("2026-06-21T13:00:00Z", 196.2, 64.1, (-0.1, -0.4, 0.9))
    shape = StoreShape(256, 2, (Layer("picture", "picture", "jpeg", 70, (sun,), 12.5), Layer("day", "sun16", "png", suns=(sun, sun))))
    SqliteTileStore.create(tmp_path / "light.sqlite", shape).close()
    SqliteTileStore.open_or_create(tmp_path / "light.sqlite", shape).close()
    other = StoreShape(256, 2, (replace(shape.layers[0], radius_m=13.0), shape.layers[1]))
    with pytest.raises(BadRequest, match="--regrid"):
        SqliteTileStore.open_or_create(tmp_path / "light.sqlite", other)


def test_a_disk_that_fails_while_a_store_is_opened_is_a_store_error(path, store, monkeypatch):
    """Found by failing system calls: the format's version could not be read."""

    def fail(_db):
        raise sqlite3.DatabaseError("database disk image is malformed")

    monkeypatch.setattr("map3d.tiles.sqlite_store._version", fail)
    with pytest.raises(StoreError, match="cannot read"):
        SqliteTileStore(path)
