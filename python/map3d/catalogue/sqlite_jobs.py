"""Jobs in SQLite: every transition of states.py is one statement that checks the state it starts from. Times are on SQLite's clock."""

import sqlite3
from collections.abc import Iterable, Iterator
from typing import Any, Final

from map3d.catalogue.records import Job, JobResult, Lease, PlanCounts, PlannedJob
from map3d.catalogue.states import MAX_ATTEMPTS, MAX_EXPIRIES, OPEN, JobEvent, State, next_state, sources
from map3d.database import NOW, Database
from map3d.errors import NotFound, StaleFence
from map3d.types import BlockId

FENCES_PER_VERSION: Final = 1 << 20
"""New jobs start with this times the content version, so that after --regrid no job gets a fence that an earlier job of the same block had."""

JOB_NEXT: Final = "CREATE INDEX job_next ON job(rendering, state, attempts + expiries, z, track, morton)"
JOB_SCHEMA: Final = f"""
CREATE TABLE job(rendering TEXT NOT NULL REFERENCES rendering(name), track TEXT NOT NULL, z INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL,
  kind TEXT NOT NULL, morton INTEGER NOT NULL, key TEXT NOT NULL, parent_z INTEGER, parent_x INTEGER, parent_y INTEGER,
  state TEXT NOT NULL, attempts INTEGER NOT NULL DEFAULT 0, expiries INTEGER NOT NULL DEFAULT 0,
  fence INTEGER NOT NULL DEFAULT 0, worker TEXT, expires REAL, reason TEXT,
  version INTEGER, empty INTEGER, tiles INTEGER, base_tiles INTEGER, bytes INTEGER, seconds REAL, UNIQUE(rendering, track, z, x, y));
{JOB_NEXT};
CREATE INDEX job_expiry ON job(expires) WHERE state = 'leased';
CREATE INDEX job_parent ON job(rendering, track, parent_z, parent_x, parent_y)
"""

_AT: Final = "rendering = :rendering AND track = :track AND z = :z AND x = :x AND y = :y"
_ALL_BELOW_DONE: Final = f"""NOT EXISTS (SELECT 1 FROM job AS below WHERE below.rendering = job.rendering AND below.track = job.track
  AND below.parent_z = job.z AND below.parent_x = job.x AND below.parent_y = job.y AND below.state <> '{State.DONE}')"""
_AFTER_FAILURE: Final = f"CASE WHEN attempts >= {MAX_ATTEMPTS} THEN '{State.QUARANTINED}' ELSE '{next_state(State.LEASED, JobEvent.FAIL)}' END"
_AFTER_EXPIRY: Final = f"CASE WHEN expiries + 1 >= {MAX_EXPIRIES} THEN '{State.QUARANTINED}' ELSE '{next_state(State.LEASED, JobEvent.EXPIRE)}' END"
_EXPIRE: Final = f"""UPDATE job SET state = {_AFTER_EXPIRY}, attempts = attempts - 1, expiries = expiries + 1, worker = NULL, expires = NULL,
  reason = 'lease expired ' || (expiries + 1) || iif(expiries, ' times', ' time') || ' (last worker: ' || worker || ')'
  WHERE state = '{State.LEASED}'"""
_EXPIRE_OVERDUE: Final = f"{_EXPIRE} AND expires < {NOW}"
_NEXT: Final = (
    f"""SELECT {{columns}} FROM job WHERE rendering = :rendering AND state = '{State.TODO}' ORDER BY attempts + expiries, z, track, morton LIMIT 1"""
)
_LEASE: Final = f"""UPDATE job SET state = '{next_state(State.TODO, JobEvent.LEASE)}', attempts = attempts + 1, fence = fence + 1, worker = :worker,
  expires = {NOW} + :lease_s
  WHERE rowid = coalesce(
    (SELECT rowid FROM job WHERE rendering = :rendering AND state = '{State.TODO}' AND morton >= :start
      AND (attempts + expiries, z, track) = ({_NEXT.format(columns="attempts + expiries, z, track")}) ORDER BY morton LIMIT 1),
    ({_NEXT.format(columns="rowid")}))
  RETURNING *, (SELECT content_version FROM rendering WHERE name = rendering) AS content_version"""
_HELD: Final = f"{_AT} AND state = '{State.LEASED}' AND fence = :fence AND expires >= {NOW}"


class SqliteJobs:
    """The job methods of the SQLite catalogue."""

    def __init__(self, database: Database, lease_s: float) -> None:
        self._database = database
        self.lease_s = lease_s

    def plan(self, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
        with self._database.transaction() as db:
            content_version, announced = _versions(db, rendering)
            keys = {(row["track"], row["z"], row["x"], row["y"]): row["key"] for row in _job_rows(db, rendering)}
            added, changed, kept = [], [], 0
            for job in jobs:
                key = keys.get((job.track, *job.block))
                if key is None:
                    added.append({**_planned_row(rendering, job), "fence": content_version * FENCES_PER_VERSION})
                elif key != job.key:
                    changed.append(_planned_row(rendering, job))
                else:
                    kept += 1
            _add(db, added)
            _reopen(db, changed)
            db.execute(f"UPDATE job SET state = '{State.TODO}' WHERE rendering = ? AND state = '{State.WAITING}' AND {_ALL_BELOW_DONE}", (rendering,))
            if announced >= content_version and _any_open(db, rendering):
                db.execute("UPDATE rendering SET content_version = ? WHERE name = ?", (announced + 1, rendering))
        return PlanCounts(len(added), len(changed), kept)

    def lease(self, rendering: str, worker: str, start: int = 0) -> Lease | None:
        with self._database.transaction() as db:
            db.execute(_EXPIRE_OVERDUE)
            row = db.execute(_LEASE, {"rendering": rendering, "worker": worker, "lease_s": self.lease_s, "start": start}).fetchone()
        return None if row is None else _lease(row)

    def heartbeat(self, lease: Lease) -> None:
        self._move(lease, f"expires = {NOW} + :lease_s", lease_s=self.lease_s)

    def done(self, lease: Lease, result: JobResult) -> None:
        numbers = {name: getattr(result, name) for name in ("version", "empty", "tiles", "base_tiles", "bytes", "seconds")}
        change = f"state = '{next_state(State.LEASED, JobEvent.DONE)}', worker = NULL, expires = NULL, reason = NULL, "
        self._move(lease, change + ", ".join(f"{name} = :{name}" for name in numbers), wake=True, **numbers)

    def fail(self, lease: Lease, reason: str) -> State:
        row = self._move(lease, f"state = {_AFTER_FAILURE}, worker = NULL, expires = NULL, reason = :reason", reason=reason)
        return State(row["state"])

    def release(self, lease: Lease) -> None:
        self._move(lease, f"state = '{next_state(State.LEASED, JobEvent.RELEASE)}', attempts = attempts - 1, worker = NULL, expires = NULL")

    def expire(self, rendering: str, workers: Iterable[str]) -> int:
        with self._database.transaction() as db:
            return sum(db.execute(f"{_EXPIRE} AND rendering = ? AND worker = ?", (rendering, worker)).rowcount for worker in set(workers))

    def retry(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        change = f"UPDATE job SET state = '{State.TODO}', attempts = 0, expiries = 0 WHERE state IN ({_quoted(sources(JobEvent.RETRY))})"
        with self._database.transaction() as db:
            content_version, announced = _versions(db, rendering)
            if blocks is None:
                count = db.execute(f"{change} AND rendering = ?", (rendering,)).rowcount
            else:
                count = sum(db.execute(f"{change} AND {_AT}", _place(rendering, track, block)).rowcount for track, block in blocks)
            if count and announced >= content_version:
                db.execute("UPDATE rendering SET content_version = ? WHERE name = ?", (announced + 1, rendering))
        return count

    def jobs(self, rendering: str, track: str | None = None, state: State | None = None) -> Iterator[Job]:
        with self._database.reading() as db:
            query = "SELECT * FROM job WHERE rendering = ?1 AND (?2 IS NULL OR track = ?2) AND (?3 IS NULL OR state = ?3) ORDER BY track, z, morton"
            rows = db.execute(query, (rendering, track, state)).fetchall()
        return (_job(row) for row in rows)

    def count_jobs(self, rendering: str) -> dict[State, int]:
        with self._database.transaction() as db:
            _versions(db, rendering)
            db.execute(_EXPIRE_OVERDUE)
            rows = db.execute("SELECT state, count(*) FROM job WHERE rendering = ? GROUP BY state", (rendering,)).fetchall()
        found = {row[0]: row[1] for row in rows}
        return {state: found.get(state, 0) for state in State}

    def _move(self, lease: Lease, change: str, *, wake: bool = False, **values: Any) -> sqlite3.Row:
        """Moves a leased job to another state; raises StaleFence when the lease is no longer held."""
        place = {**_place(lease.rendering, lease.track, lease.block), "fence": lease.fence}
        with self._database.transaction() as db:
            row: sqlite3.Row | None = db.execute(f"UPDATE job SET {change} WHERE {_HELD} RETURNING *", {**place, **values}).fetchone()
            if row is None:
                raise StaleFence(
                    f"job {lease.track} {lease.block}: the lease of {lease.worker} (fence {lease.fence}) is no longer held; {_holder(db, place)}"
                )
            if wake:
                _wake_above(db, row)
        return row


def _add(db: sqlite3.Connection, rows: list[dict[str, Any]]) -> None:
    columns = "rendering, track, z, x, y, kind, morton, key, parent_z, parent_x, parent_y, state, fence"
    db.executemany(f"INSERT INTO job({columns}) VALUES (:{columns.replace(', ', ', :')})", rows)


def _reopen(db: sqlite3.Connection, rows: list[dict[str, Any]]) -> None:
    """Increments the fence too, so that a worker that still renders the old state loses its lease."""
    change = "key = :key, state = :state, attempts = 0, expiries = 0, fence = fence + 1, worker = NULL, expires = NULL, reason = NULL"
    db.executemany(f"UPDATE job SET {change} WHERE {_AT}", rows)


def _wake_above(db: sqlite3.Connection, row: sqlite3.Row) -> None:
    place = {"rendering": row["rendering"], "track": row["track"], "z": row["parent_z"], "x": row["parent_x"], "y": row["parent_y"]}
    after = next_state(State.WAITING, JobEvent.BELOW_DONE)
    db.execute(f"UPDATE job SET state = '{after}' WHERE {_AT} AND state = '{State.WAITING}' AND {_ALL_BELOW_DONE}", place)


def _versions(db: sqlite3.Connection, rendering: str) -> tuple[int, int]:
    row = db.execute("SELECT content_version, announced_version FROM rendering WHERE name = ?", (rendering,)).fetchone()
    if row is None:
        raise NotFound(f"no rendering {rendering!r}")
    return int(row[0]), int(row[1])


def _any_open(db: sqlite3.Connection, rendering: str) -> bool:
    query = f"SELECT 1 FROM job WHERE rendering = ? AND state IN ({_quoted(OPEN)}) LIMIT 1"
    return db.execute(query, (rendering,)).fetchone() is not None


def _job_rows(db: sqlite3.Connection, rendering: str) -> list[sqlite3.Row]:
    return db.execute("SELECT * FROM job WHERE rendering = ? ORDER BY track, z, morton", (rendering,)).fetchall()


def _holder(db: sqlite3.Connection, place: dict[str, Any]) -> str:
    row = db.execute(f"SELECT state, fence, worker FROM job WHERE {_AT}", place).fetchone()
    if row is None:
        return "the job no longer exists"
    worker = f", leased by {row['worker']}" if row["worker"] else ""
    return f"the job is {row['state']} with fence {row['fence']}{worker}"


def _planned_row(rendering: str, job: PlannedJob) -> dict[str, Any]:
    above = job.parent or (None, None, None)
    row = {**_place(rendering, job.track, job.block), "kind": job.kind, "morton": job.order, "key": job.key}
    row |= {"parent_z": above[0], "parent_x": above[1], "parent_y": above[2]}
    return {**row, "state": State.TODO if job.kind == "base" else State.WAITING}


def _place(rendering: str, track: str, block: BlockId) -> dict[str, Any]:
    return {"rendering": rendering, "track": track, "z": block.z, "x": block.x, "y": block.y}


def _quoted(states: Iterable[State]) -> str:
    return ", ".join(f"'{state}'" for state in states)


def _lease(row: sqlite3.Row) -> Lease:
    return Lease(
        rendering=row["rendering"],
        track=row["track"],
        block=BlockId(row["z"], row["x"], row["y"]),
        kind=row["kind"],
        key=row["key"],
        fence=row["fence"],
        attempt=row["attempts"],
        worker=row["worker"],
        content_version=row["content_version"],
    )


def _job(row: sqlite3.Row) -> Job:
    done = row["version"] is not None
    result = JobResult(row["version"], bool(row["empty"]), row["tiles"], row["base_tiles"], row["bytes"], row["seconds"]) if done else None
    return Job(
        rendering=row["rendering"],
        track=row["track"],
        block=BlockId(row["z"], row["x"], row["y"]),
        kind=row["kind"],
        key=row["key"],
        state=State(row["state"]),
        attempts=row["attempts"],
        expiries=row["expiries"],
        fence=row["fence"],
        worker=row["worker"],
        expires_s=row["expires"],
        reason=row["reason"],
        result=result,
    )
