"""A tile store in SQLite, one file per track (spec/catalogue.md): WAL, synchronous=FULL, one transaction per block."""

import hashlib
import json
import os
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from map3d.database import BUSY_TIMEOUT_S, Connections, run_script
from map3d.errors import AlreadyExists, BadRequest, Corrupt, Map3dError, NotFound, StaleFence, StoreError, UnknownVersion
from map3d.tiles.naming import block_level, morton
from map3d.tiles.tile_store import FORMAT_VERSION, StoredBlock, StoredTile, StoreFault, StoreShape, check_block, content_hash
from map3d.types import BlockId, Layer, TileId

APPLICATION_ID: Final = 0x4D334454  # "M3DT"
PAGE_BYTES: Final = 16_384
CHECKPOINT_PAGES: Final = 2_000
CACHE_KIB: Final = 16_384

_SCHEMA: Final = """
CREATE TABLE blob(hash BLOB PRIMARY KEY, bytes BLOB NOT NULL);
CREATE TABLE tile(layer INTEGER, z INTEGER, x INTEGER, y INTEGER, block TEXT NOT NULL, hash BLOB NOT NULL, PRIMARY KEY(layer, z, x, y)) WITHOUT ROWID;
CREATE INDEX tile_hash ON tile(hash);
CREATE TABLE block(id TEXT PRIMARY KEY, z INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL, key TEXT NOT NULL,
  version INTEGER NOT NULL, tiles INTEGER NOT NULL, seam BLOB, fence INTEGER NOT NULL DEFAULT 0);
CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT NOT NULL);
"""
_MIGRATIONS: Final = {2: "ALTER TABLE block ADD COLUMN fence INTEGER NOT NULL DEFAULT 0"}
"""Version → statements that lead to it from the version before. Stores of every version can be read."""


class SqliteTileStore:
    """A `TileStore` that threads and forked processes may share; each has its own connection."""

    def __init__(self, path: Path, *, read_only: bool = False) -> None:
        """Opens an existing store, and migrates an older one unless it is `read_only`. Raises NotFound, UnknownVersion, Corrupt, StoreError."""
        if not path.is_file():
            raise NotFound(f"{path}: no such tile store; render the rendering first")
        self.path = path
        self._identity = _identity(path)
        self._read_only = read_only
        self._connections = Connections(path, lambda: _connect(path, read_only))
        try:
            self._shape = self._read_shape()
            if not read_only:
                self._migrate()
        except BaseException:
            self.close()
            raise

    @classmethod
    def create(cls, path: Path, shape: StoreShape) -> Self:
        """Creates an empty store, atomically. Raises AlreadyExists, StoreError."""
        if path.exists():
            raise AlreadyExists(f"{path}: the tile store already exists")
        draft = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}.new")
        draft.unlink(missing_ok=True)
        try:
            _write_empty(draft, shape)
            os.link(draft, path)
        except FileExistsError as error:
            raise AlreadyExists(f"{path}: the tile store already exists") from error
        except (OSError, sqlite3.Error) as error:
            raise StoreError(f"{path}: cannot create the tile store: {error}") from error
        finally:
            draft.unlink(missing_ok=True)
        return cls(path)

    @classmethod
    def open_or_create(cls, path: Path, shape: StoreShape) -> Self:
        """Opens the store, or creates it. Raises BadRequest if an existing store has a different shape."""
        try:
            return cls.create(path, shape)
        except AlreadyExists:
            store = cls(path)
        if store.shape != shape:
            store.close()
            raise BadRequest(f"{path}: the store has {store.shape}, expected {shape}; use --regrid to render from scratch")
        return store

    @property
    def shape(self) -> StoreShape:
        return self._shape

    @property
    def url(self) -> str:
        return str(self.path)

    def put_block(self, block: BlockId, key: str, version: int, tiles: Sequence[StoredTile], seam: bytes | None, *, fence: int = 0) -> StoredBlock:
        check_block(self._shape, block, version, tiles)
        hashed = [(tile, content_hash(tile.data)) for tile in tiles]
        with self._transaction() as db:
            old = _block_row(db, block)
            if old and fence < old["fence"]:
                raise StaleFence(f"block {block}: fence {fence} is stale; the stored tiles have fence {old['fence']}")
            before = _tile_hashes(db, self._shape, block) if old else {}
            now = {tuple(tile[:4]): digest for tile, digest in hashed}
            if old and before == now and old["seam"] == seam:
                version = old["version"]
            else:
                _delete_tiles(db, before)
                _insert_tiles(db, block, hashed)
                _delete_unused_blobs(db, set(before.values()) - set(now.values()))
            db.execute("INSERT OR REPLACE INTO block VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", (str(block), *block, key, version, len(tiles), seam, fence))
        return StoredBlock(block, key, version, len(tiles))

    def remove_block(self, block: BlockId) -> bool:
        with self._transaction() as db:
            if _block_row(db, block) is None:
                return False
            before = _tile_hashes(db, self._shape, block)
            _delete_tiles(db, before)
            db.execute("DELETE FROM block WHERE id = ?", (str(block),))
            _delete_unused_blobs(db, set(before.values()))
        return True

    def get_tile(self, layer: int, z: int, x: int, y: int) -> bytes | None:
        with self._reading() as db:
            row = db.execute(
                "SELECT blob.bytes FROM tile LEFT JOIN blob USING (hash) WHERE layer = ? AND z = ? AND x = ? AND y = ?", (layer, z, x, y)
            ).fetchone()
        if row is not None and row[0] is None:
            raise Corrupt(f"{self.path}: tile {layer}: {z}/{x}/{y} has no bytes; remove the file and render again")
        return None if row is None else bytes(row[0])

    def read_tiles(self, layer: int, tiles: Iterable[TileId]) -> Iterator[bytes | None]:
        return (self.get_tile(layer, *tile) for tile in tiles)

    def get_seam(self, block: BlockId) -> bytes | None:
        with self._reading() as db:
            row = db.execute("SELECT seam FROM block WHERE id = ?", (str(block),)).fetchone()
        return None if row is None or row[0] is None else bytes(row[0])

    def get_seams(self, blocks: Iterable[BlockId]) -> dict[BlockId, bytes]:
        found = ((block, self.get_seam(block)) for block in blocks)
        return {block: seam for block, seam in found if seam is not None}

    def get_block(self, block: BlockId) -> StoredBlock | None:
        with self._reading() as db:
            row = db.execute("SELECT key, version, tiles FROM block WHERE id = ?", (str(block),)).fetchone()
        return None if row is None else StoredBlock(block, row[0], row[1], row[2])

    def list_blocks(self) -> list[StoredBlock]:
        with self._reading() as db:
            rows = db.execute("SELECT z, x, y, key, version, tiles FROM block").fetchall()
        blocks = [StoredBlock(BlockId(z, x, y), key, version, tiles) for z, x, y, key, version, tiles in rows]
        return sorted(blocks, key=lambda block: (-block.id.z, morton(block.id.x, block.id.y)))

    def list_tiles(self, layer: int) -> Iterator[TileId]:
        with self._reading() as db:
            cursor = db.execute("SELECT z, x, y FROM tile WHERE layer = ? ORDER BY z, x, y", (layer,))
            for row in cursor:
                yield TileId(*row)

    def list_tile_positions(self, z: int) -> list[tuple[int, int]]:
        with self._reading() as db:
            return db.execute("SELECT x, y FROM tile WHERE layer = 0 AND z = ?", (z,)).fetchall()

    def layer_digest(self, layer: int) -> str:
        total = hashlib.sha256()
        with self._reading() as db:
            for z, x, y, digest in db.execute("SELECT z, x, y, hash FROM tile WHERE layer = ? ORDER BY z, x, y", (layer,)):
                total.update(b"%d/%d/%d " % (z, x, y) + digest)
        return total.hexdigest()

    def check(self) -> list[StoreFault]:
        with self._reading() as db:
            faults = [StoreFault(row[0]) for row in db.execute("PRAGMA integrity_check") if row[0] != "ok"]
            lost = db.execute("SELECT block, count(*) FROM tile WHERE hash NOT IN (SELECT hash FROM blob) GROUP BY block").fetchall()
            bad = [digest for digest, data in db.execute("SELECT hash, bytes FROM blob") if content_hash(data) != digest]
            of_bad = {row[0] for digest in bad for row in db.execute("SELECT DISTINCT block FROM tile WHERE hash = ?", (digest,))}
            sums = "SELECT block.id, block.tiles, count(tile.block) FROM block LEFT JOIN tile ON tile.block = block.id GROUP BY block.id"
            miscounted = [row for row in db.execute(sums) if row[1] != row[2]]
        faults += [StoreFault(f"{sum(row[1] for row in lost)} tiles without bytes", _blocks(row[0] for row in lost))] if lost else []
        faults += [StoreFault(f"{len(bad)} tiles whose bytes do not match their hash", _blocks(of_bad))] if bad else []
        return faults + [StoreFault(f"block {name}: expected {expected} tiles, found {got}", _blocks([name])) for name, expected, got in miscounted]

    def is_current(self) -> bool:
        return _identity(self.path) == self._identity

    def close(self) -> None:
        """Closes the connections of all threads. The store stays usable."""
        self._connections.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _reading(self) -> AbstractContextManager[sqlite3.Connection]:
        return self._connections.autocommit()

    def _transaction(self) -> AbstractContextManager[sqlite3.Connection]:
        if self._read_only:
            raise BadRequest(f"{self.path}: the store is open for reading only")
        return self._connections.transaction()

    def _read_shape(self) -> StoreShape:
        try:
            meta = dict(self._connections.current().execute("SELECT key, value FROM meta").fetchall())
            version = int(meta["version"])
        except sqlite3.OperationalError as error:
            raise StoreError(f"{self.path}: cannot open: {error}") from error
        except (sqlite3.DatabaseError, KeyError, ValueError) as error:
            raise Corrupt(f"{self.path}: not a tile store: {error}") from error
        if not 1 <= version <= FORMAT_VERSION:
            raise UnknownVersion(f"{self.path}: tile store version {version}; this map3d reads version {FORMAT_VERSION}")
        try:
            layers = tuple(Layer.load(row) for row in json.loads(meta["layers"]))
            return StoreShape(int(meta["tile_px"]), int(meta["zmax"]), layers)
        except (KeyError, ValueError, TypeError, Map3dError) as error:
            raise Corrupt(f"{self.path}: invalid tile store metadata: {error}") from error

    def _migrate(self) -> None:
        with self._reading() as db:
            if _version(db) == FORMAT_VERSION:
                return
        with self._transaction() as db:
            for version in range(_version(db) + 1, FORMAT_VERSION + 1):
                run_script(db, _MIGRATIONS[version])
                db.execute("UPDATE meta SET value = ? WHERE key = 'version'", (version,))


def _identity(path: Path) -> tuple[int, int] | None:
    """Returns device and inode of the file, None if it is missing."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_dev, stat.st_ino


def _version(db: sqlite3.Connection) -> int:
    return int(db.execute("SELECT value FROM meta WHERE key = 'version'").fetchone()[0])


def _connect(path: Path, read_only: bool) -> sqlite3.Connection:
    """Readers of a WAL file need a shared-memory file beside it, unless the folder is read-only."""
    mode = "rw" if not read_only else "ro&immutable=1" if _is_in_read_only_folder(path) else "ro"
    quoted = path.absolute().as_uri()
    connection = sqlite3.connect(f"{quoted}?mode={mode}", uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA synchronous = FULL")
        if not read_only:
            connection.execute(f"PRAGMA wal_autocheckpoint = {CHECKPOINT_PAGES}")
            connection.execute(f"PRAGMA cache_size = -{CACHE_KIB}")
    except BaseException:
        connection.close()
        raise
    return connection


def _is_in_read_only_folder(path: Path) -> bool:
    return not os.access(path.parent, os.W_OK) and not path.with_name(path.name + "-wal").exists()


def _write_empty(path: Path, shape: StoreShape) -> None:
    """Leaves no WAL file behind, so that the file can be linked to its final name."""
    layers = [asdict(layer) for layer in shape.layers]
    meta = {"version": FORMAT_VERSION, "tile_px": shape.tile_px, "zmax": shape.zmax, "layers": json.dumps(layers)}
    connection = sqlite3.connect(path, isolation_level=None)
    try:
        connection.execute(f"PRAGMA page_size = {PAGE_BYTES}")
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.executescript(f"BEGIN; {_SCHEMA} COMMIT;")
        connection.executemany("INSERT INTO meta VALUES (?, ?)", ((key, str(value)) for key, value in meta.items()))
        connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    finally:
        connection.close()


def _blocks(names: Iterable[str]) -> tuple[BlockId, ...]:
    return tuple(BlockId(*map(int, name.split("/"))) for name in sorted(names))


def _block_row(db: sqlite3.Connection, block: BlockId) -> dict[str, Any] | None:
    row = db.execute("SELECT version, seam, fence FROM block WHERE id = ?", (str(block),)).fetchone()
    return None if row is None else {"version": row[0], "seam": row[1], "fence": row[2]}


def _tile_hashes(db: sqlite3.Connection, shape: StoreShape, block: BlockId) -> dict[tuple[int, ...], bytes]:
    """Returns (layer, z, x, y) → hash of the block's tiles. Queries column by column to use the primary key."""
    query = "SELECT layer, z, x, y, hash FROM tile WHERE layer = ? AND z = ? AND x = ? AND y BETWEEN ? AND ?"
    found: dict[tuple[int, ...], bytes] = {}
    for layer in range(len(shape.layers)):
        for down in range(block_level(block.z, shape.zmax).levels):
            first_y = block.y << down
            for x in range(block.x << down, (block.x + 1) << down):
                rows = db.execute(query, (layer, block.z + down, x, first_y, first_y + (1 << down) - 1))
                found.update(((row[0], row[1], row[2], row[3]), row[4]) for row in rows)
    return found


def _insert_tiles(db: sqlite3.Connection, block: BlockId, hashed: Sequence[tuple[StoredTile, bytes]]) -> None:
    db.executemany("INSERT OR IGNORE INTO blob VALUES (?, ?)", ((digest, tile.data) for tile, digest in hashed))
    rows = ((tile.layer, tile.z, tile.x, tile.y, str(block), digest) for tile, digest in hashed)
    db.executemany("INSERT INTO tile VALUES (?, ?, ?, ?, ?, ?)", rows)


def _delete_tiles(db: sqlite3.Connection, tiles: dict[tuple[int, ...], bytes]) -> None:
    db.executemany("DELETE FROM tile WHERE layer = ? AND z = ? AND x = ? AND y = ?", tiles)


def _delete_unused_blobs(db: sqlite3.Connection, hashes: set[bytes]) -> None:
    """Deletes the blobs that no tile references."""
    query = "DELETE FROM blob WHERE hash = ?1 AND NOT EXISTS (SELECT 1 FROM tile WHERE hash = ?1)"
    db.executemany(query, ((digest,) for digest in sorted(hashes)))
