"""Jobs in SQLite: every transition of states.py is one statement that checks the state it starts from. Times are on SQLite's clock."""

import sqlite3
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final

from map3d.catalogue import sqlite_plan
from map3d.catalogue.records import Job, JobResult, Lease, PlanCounts, PlannedJob
from map3d.catalogue.sqlite_job_table import AT, RESULT, load_job, load_lease, place_of, result_row
from map3d.catalogue.states import MAX_ATTEMPTS, MAX_EXPIRIES, JobEvent, State, next_state
from map3d.database import NOW, Database
from map3d.errors import StaleFence
from map3d.messages import Message, dump_text
from map3d.types import BlockId

PLAN_BATCH: Final = 5_000
"""Jobs that one transaction plans."""
PAGE: Final = 2_000
"""Jobs that one query reads."""

_AFTER_FAILURE: Final = f"CASE WHEN attempts >= {MAX_ATTEMPTS} THEN '{State.QUARANTINED}' ELSE '{next_state(State.LEASED, JobEvent.FAIL)}' END"
_AFTER_EXPIRY: Final = f"CASE WHEN expiries + 1 >= {MAX_EXPIRIES} THEN '{State.QUARANTINED}' ELSE '{next_state(State.LEASED, JobEvent.EXPIRE)}' END"
_EXPIRE: Final = f"""UPDATE job SET state = {_AFTER_EXPIRY}, attempts = attempts - 1, expiries = expiries + 1, worker = NULL, expires = NULL,
  reason = json_object('code', 'lease-expired', 'values', json_object('count', expiries + 1, 'worker', worker))
  WHERE state = '{State.LEASED}'"""
_EXPIRE_OVERDUE: Final = f"{_EXPIRE} AND expires < {NOW}"
_NEXT: Final = f"""SELECT {{columns}} FROM job WHERE rendering = :rendering AND state = '{State.TODO}'
  ORDER BY attempts + expiries, z, ground, track, morton LIMIT 1"""
_WITH_VERSION: Final = "RETURNING *, (SELECT content_version FROM rendering WHERE name = rendering) AS content_version"
_LEASE: Final = f"""UPDATE job SET state = '{next_state(State.TODO, JobEvent.LEASE)}', attempts = attempts + 1, fence = fence + 1, worker = :worker,
  leased = {NOW}, expires = {NOW} + :lease_s
  WHERE rowid = coalesce(
    (SELECT rowid FROM job WHERE rendering = :rendering AND state = '{State.TODO}' AND ground >= :start
      AND (attempts + expiries, z) = ({_NEXT.format(columns="attempts + expiries, z")}) ORDER BY ground, track, morton LIMIT 1),
    ({_NEXT.format(columns="rowid")}))
  {_WITH_VERSION}"""
_LEASE_BLOCK: Final = f"""UPDATE job SET state = '{next_state(State.TODO, JobEvent.LEASE)}', attempts = attempts + 1, fence = fence + 1,
  worker = :worker, leased = {NOW}, expires = {NOW} + :lease_s WHERE {AT} AND state = '{State.TODO}' {_WITH_VERSION}"""
_EVICT: Final = f"""UPDATE job SET state = '{next_state(State.DONE, JobEvent.EVICT)}', attempts = 1, expiries = 0, fence = fence + 1,
  worker = :worker, leased = {NOW}, expires = {NOW} + :lease_s WHERE {AT} AND state = '{State.DONE}' AND kind = 'base'
  AND EXISTS (SELECT 1 FROM job_count AS other WHERE other.rendering = :rendering AND other.state <> '{State.DONE}' AND other.jobs > 0)
  {_WITH_VERSION}"""
_HELD: Final = f"{AT} AND state = '{State.LEASED}' AND fence = :fence AND worker = :worker AND expires >= {NOW}"
_ORDER: Final = "ORDER BY track, z, morton, x, y"
_PAGE: Final = f"""SELECT * FROM job WHERE rendering = :rendering AND {{after}}
  AND (:state IS NULL OR state = :state) {_ORDER} LIMIT {PAGE}"""
_PAGE_OF_ALL: Final = _PAGE.format(after="(track, z, morton, x, y) > (:track, :z, :morton, :x, :y)")
_PAGE_OF_TRACK: Final = _PAGE.format(after="track = :track AND (z, morton, x, y) > (:z, :morton, :x, :y)")
_BELOW: Final = """SELECT * FROM job WHERE rendering = :rendering AND track = :track
  AND parent_z = :z AND parent_x = :x AND parent_y = :y ORDER BY morton"""
_IN_STATE: Final = f"""SELECT * FROM job INDEXED BY job_next WHERE rendering = :rendering AND state = :state
  AND (:track IS NULL OR track = :track) {_ORDER}"""


class SqliteJobs:
    """The job methods of the SQLite catalogue."""

    def __init__(self, database: Database, lease_s: float) -> None:
        self._database = database
        self.lease_s = lease_s

    # -- opening and closing ----------------------------------------------------------------------------------------------------

    def plan(self, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
        with self._database.reading() as db:
            sqlite_plan.check_rendering(db, rendering)
        counts, remaining = PlanCounts(), iter(jobs)
        while batch := list(islice(remaining, PLAN_BATCH)):
            with self._database.transaction() as db:
                counts += sqlite_plan.plan_batch(db, rendering, batch)
        with self._database.transaction() as db:
            sqlite_plan.end_plan(db, rendering)
        return counts

    def sweep(self, rendering: str) -> int:
        with self._database.transaction() as db:
            return sqlite_plan.sweep(db, rendering)

    def retry(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        with self._database.transaction() as db:
            sqlite_plan.check_rendering(db, rendering)
            return sqlite_plan.retry(db, rendering, blocks)

    def cancel(self, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None = None) -> int:
        with self._database.transaction() as db:
            sqlite_plan.check_rendering(db, rendering)
            return sqlite_plan.cancel(db, rendering, blocks)

    def reopen(self, rendering: str, blocks: Iterable[tuple[str, BlockId]]) -> int:
        with self._database.transaction() as db:
            sqlite_plan.check_rendering(db, rendering)
            return sqlite_plan.reopen(db, rendering, blocks)

    # -- leases -----------------------------------------------------------------------------------------------------------------

    def lease(self, rendering: str, worker: str, start: int = 0) -> Lease | None:
        with self._database.transaction() as db:
            db.execute(_EXPIRE_OVERDUE)
            row = db.execute(_LEASE, {"rendering": rendering, "worker": worker, "lease_s": self.lease_s, "start": start}).fetchone()
        return None if row is None else load_lease(row)

    def lease_block(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        with self._database.transaction() as db:
            db.execute(_EXPIRE_OVERDUE)
            row = db.execute(_LEASE_BLOCK, self._lease_values(rendering, worker, track, block)).fetchone()
        return None if row is None else load_lease(row)

    def evict(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        with self._database.transaction() as db:
            row = db.execute(_EVICT, self._lease_values(rendering, worker, track, block)).fetchone()
            if row is not None:
                sqlite_plan.wait_above_evicted(db, row)
        return None if row is None else load_lease(row)

    def _lease_values(self, rendering: str, worker: str, track: str, block: BlockId) -> dict[str, Any]:
        return {**place_of(rendering, track, block), "worker": worker, "lease_s": self.lease_s}

    def heartbeat(self, lease: Lease) -> None:
        with self._database.transaction() as db:
            _move(db, lease, f"expires = {NOW} + :lease_s", lease_s=self.lease_s)

    def done(self, lease: Lease, result: JobResult) -> None:
        change = f"state = '{next_state(State.LEASED, JobEvent.DONE)}', worker = NULL, expires = NULL, ended = {NOW}, reason = NULL, "
        with self._database.transaction() as db:
            row = _move(db, lease, change + ", ".join(f"{name} = :{name}" for name in RESULT), **result_row(result))
            self._open_above(db, row)

    def _open_above(self, db: sqlite3.Connection, row: sqlite3.Row) -> None:
        sqlite_plan.open_above(db, row)

    def fail(self, lease: Lease, reason: Message) -> State:
        with self._database.transaction() as db:
            row = _move(db, lease, f"state = {_AFTER_FAILURE}, worker = NULL, expires = NULL, reason = :reason", reason=dump_text(reason))
        return State(row["state"])

    def release(self, lease: Lease) -> None:
        with self._database.transaction() as db:
            _move(db, lease, f"state = '{next_state(State.LEASED, JobEvent.RELEASE)}', attempts = attempts - 1, worker = NULL, expires = NULL")

    def expire(self, rendering: str, workers: Iterable[str]) -> int:
        with self._database.transaction() as db:
            return sum(db.execute(f"{_EXPIRE} AND rendering = ? AND worker = ?", (rendering, worker)).rowcount for worker in set(workers))

    # -- queries ----------------------------------------------------------------------------------------------------------------

    def jobs(self, rendering: str, track: str | None = None, state: State | None = None) -> Iterator[Job]:
        if state is not None and self._counts(rendering).get(state, 0) <= PAGE:
            yield from map(load_job, self._rows(_IN_STATE, {"rendering": rendering, "track": track, "state": state}))
            return
        page = _PAGE_OF_ALL if track is None else _PAGE_OF_TRACK
        after: dict[str, Any] = {"track": track or "", "z": -1, "morton": 0, "x": 0, "y": 0}
        while rows := self._rows(page, {"rendering": rendering, "state": state, **after}):
            yield from map(load_job, rows)
            after = {name: rows[-1][name] for name in after}

    def job(self, rendering: str, track: str, block: BlockId) -> Job | None:
        rows = self._rows(f"SELECT * FROM job WHERE {AT}", place_of(rendering, track, block))
        return load_job(rows[0]) if rows else None

    def jobs_below(self, rendering: str, track: str, block: BlockId) -> list[Job]:
        return [load_job(row) for row in self._rows(_BELOW, place_of(rendering, track, block))]

    def _rows(self, query: str, values: dict[str, Any]) -> list[sqlite3.Row]:
        with self._database.reading() as db:
            return db.execute(query, values).fetchall()

    def clock_s(self) -> float:
        with self._database.reading() as db:
            return float(db.execute(f"SELECT {NOW}").fetchone()[0])

    def has_open_jobs(self, rendering: str) -> bool:
        with self._database.reading() as db:
            return sqlite_plan.any_open(db, rendering, (State.TODO, State.LEASED))

    def count_jobs(self, rendering: str) -> dict[State, int]:
        with self._database.reading() as db:
            sqlite_plan.check_rendering(db, rendering)
        found = self._counts(rendering)
        return {state: found.get(state, 0) for state in State}

    def _counts(self, rendering: str) -> dict[str, int]:
        return {row["state"]: row["jobs"] for row in self._rows("SELECT state, jobs FROM job_count WHERE rendering = :name", {"name": rendering})}


def _move(db: sqlite3.Connection, lease: Lease, change: str, **values: Any) -> sqlite3.Row:
    """Moves a leased job to another state and returns it; raises StaleFence when the lease is no longer held."""
    place = {**place_of(lease.rendering, lease.track, lease.block), "fence": lease.fence, "worker": lease.worker}
    row: sqlite3.Row | None = db.execute(f"UPDATE job SET {change} WHERE {_HELD} RETURNING *", {**place, **values}).fetchone()
    if row is None:
        raise StaleFence(
            f"job {lease.track} {lease.block}: the lease of {lease.worker} (fence {lease.fence}) is no longer held; {_holder(db, place)}"
        )
    return row


def _holder(db: sqlite3.Connection, place: dict[str, Any]) -> str:
    row = db.execute(f"SELECT state, fence, worker FROM job WHERE {AT}", place).fetchone()
    if row is None:
        return "the job no longer exists"
    worker = f", leased by {row['worker']}" if row["worker"] else ""
    return f"the job is {row['state']} with fence {row['fence']}{worker}"
