"""The cache of blocks that were rendered on demand: a quota, and eviction of the least recently used blocks (docs/on-demand.md).

The file `on-demand.sqlite` in the workspace lists the blocks with their sizes and last use; the tiles are in the ordinary tile stores. A block is
counted before it is written. It is evicted in this order: its job is open again (`Catalogue.evict`), its tiles are removed, its row is removed; so a
done job always has its tiles, wherever the process is killed. Blocks of complete renderings leave the list and stay.
"""

from collections.abc import Iterable
from typing import Final

from map3d.catalogue import Catalogue, Lease, RenderingRecord, State, Workspace
from map3d.database import NOW, Database
from map3d.errors import LimitExceeded, NotFound, StaleFence
from map3d.tiles.track_stores import find_track
from map3d.types import BlockId

BlockAddress = tuple[str, str, BlockId]
"""Rendering, track, block."""

FILE: Final = "on-demand.sqlite"
_VERSION: Final = 1
_SCHEMA: Final = """
CREATE TABLE block(rendering TEXT NOT NULL, track TEXT NOT NULL, z INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL, kind TEXT NOT NULL,
  bytes INTEGER NOT NULL, used REAL NOT NULL, PRIMARY KEY(rendering, track, z, x, y)) WITHOUT ROWID;
CREATE INDEX block_used ON block(kind, used);
"""
_AT: Final = "rendering = ? AND track = ? AND z = ? AND x = ? AND y = ?"
_TOTAL: Final = f"SELECT coalesce(sum(bytes), 0) FROM block WHERE NOT ({_AT})"
_OLDEST: Final = "SELECT rendering, track, z, x, y FROM block WHERE kind = 'base' ORDER BY used, rendering, track, z, x, y"


class OnDemandCache:
    """Threads and processes may share the file. `worker` is the name under which blocks are leased while they are evicted."""

    def __init__(self, workspace: Workspace, catalogue: Catalogue, quota_bytes: int, worker: str) -> None:
        self._workspace, self._catalogue, self._worker = workspace, catalogue, worker
        self.quota_bytes = quota_bytes
        self._database = Database(workspace.root / FILE, _SCHEMA, _VERSION)
        self.evicted = 0
        """Number of blocks that this process has evicted."""

    def close(self) -> None:
        self._database.close()

    def reserve(self, lease: Lease, size_bytes: int) -> None:
        """Counts a block that is about to be written, after evicting others until it fits. Raises LimitExceeded if they do not suffice."""
        address = (lease.rendering, lease.track, lease.block)
        spared = {address}
        while not self._insert_if_it_fits(address, lease.kind, size_bytes):
            oldest = self._oldest(spared)
            if oldest is None:
                raise LimitExceeded(
                    f"on-demand cache: a block of {size_bytes} bytes does not fit into the quota of {self.quota_bytes} bytes, and no other block "
                    f"can be evicted; raise --on-demand-quota, or render the rendering with map3d render"
                )
            if not self._evict(oldest):
                spared.add(oldest)

    def touch(self, addresses: Iterable[BlockAddress]) -> None:
        """Records that blocks were used now."""
        with self._database.transaction() as db:
            db.executemany(f"UPDATE block SET used = {NOW} WHERE {_AT}", [_key(address) for address in addresses])

    def used_bytes(self) -> int:
        with self._database.autocommit() as db:
            return int(db.execute("SELECT coalesce(sum(bytes), 0) FROM block").fetchone()[0])

    def addresses(self) -> list[BlockAddress]:
        """Returns the blocks in the cache, least recently used first."""
        with self._database.autocommit() as db:
            rows = db.execute("SELECT rendering, track, z, x, y FROM block ORDER BY used, rendering, track, z, x, y").fetchall()
        return [_address(row) for row in rows]

    def _insert_if_it_fits(self, address: BlockAddress, kind: str, size_bytes: int) -> bool:
        with self._database.transaction() as db:
            others = int(db.execute(_TOTAL, _key(address)).fetchone()[0])
            if others + size_bytes > self.quota_bytes:
                return False
            db.execute(f"INSERT OR REPLACE INTO block VALUES (?, ?, ?, ?, ?, ?, ?, {NOW})", (*_key(address), kind, size_bytes))
        return True

    def _oldest(self, spared: set[BlockAddress]) -> BlockAddress | None:
        with self._database.autocommit() as db:
            return next((address for row in db.execute(_OLDEST) if (address := _address(row)) not in spared), None)

    def _evict(self, address: BlockAddress) -> bool:
        """Evicts a block; returns False if it is in use. Blocks of complete or removed renderings only leave the list."""
        rendering, track, block = address
        try:
            record, counts = self._catalogue.rendering(rendering), self._catalogue.count_jobs(rendering)
        except NotFound:
            return self._forget("rendering = ?", (rendering,))
        if counts[State.DONE] == sum(counts.values()):
            return self._forget("rendering = ?", (rendering,))
        lease = self._catalogue.evict(rendering, self._worker, track, block) or self._catalogue.lease_block(rendering, self._worker, track, block)
        if lease is not None:
            return self._remove_leased(record, address, lease)
        job = self._catalogue.job(rendering, track, block)
        if job is not None and job.state not in (State.CANCELLED, State.QUARANTINED):
            return False
        self._remove_tiles(record, address)
        return True

    def _remove_leased(self, record: RenderingRecord, address: BlockAddress, lease: Lease) -> bool:
        try:
            self._catalogue.heartbeat(lease)
            self._remove_tiles(record, address)
            self._catalogue.release(lease)
        except StaleFence:
            return False
        self.evicted += 1
        return True

    def _remove_tiles(self, record: RenderingRecord, address: BlockAddress) -> None:
        found = find_track(self._workspace, record, address[1], read_only=False)
        if found is not None:
            with found as store:
                store.remove_block(address[2])
        self._forget(_AT, _key(address))

    def _forget(self, condition: str, values: tuple[str | int, ...]) -> bool:
        with self._database.transaction() as db:
            db.execute(f"DELETE FROM block WHERE {condition}", values)
        return True


def _key(address: BlockAddress) -> tuple[str | int, ...]:
    rendering, track, block = address
    return (rendering, track, *block)


def _address(row: Iterable[str | int]) -> BlockAddress:
    rendering, track, z, x, y = row
    return str(rendering), str(track), BlockId(int(z), int(x), int(y))
