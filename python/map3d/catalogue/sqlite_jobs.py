"""Jobs in SQLite: every transition of states.py is one statement of jobs.sql that checks the state it starts from. Times are on SQLite's clock."""

import sqlite3
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Final

from map3d.catalogue import sqlite_plan
from map3d.catalogue.records import Job, JobResult, Lease, PlanCounts, PlannedJob
from map3d.catalogue.sqlite_job_table import load_job, load_lease, place_of, result_row
from map3d.catalogue.sqlite_plan import SQL
from map3d.catalogue.states import MAX_ATTEMPTS, MAX_EXPIRIES, State
from map3d.database import NOW, Database
from map3d.errors import StaleFence
from map3d.messages import Message, dump_text
from map3d.types import BlockId

PLAN_BATCH: Final = 5_000
"""Jobs that one transaction plans."""
PAGE: Final = 2_000
"""Jobs that one query reads."""


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
            db.execute(SQL["expire_overdue"], {"max_expiries": MAX_EXPIRIES})
            row = db.execute(SQL["lease"], {"rendering": rendering, "worker": worker, "lease_s": self.lease_s, "start": start}).fetchone()
        return None if row is None else load_lease(row)

    def lease_block(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        with self._database.transaction() as db:
            db.execute(SQL["expire_overdue"], {"max_expiries": MAX_EXPIRIES})
            row = db.execute(SQL["lease_block"], self._lease_values(rendering, worker, track, block)).fetchone()
        return None if row is None else load_lease(row)

    def evict(self, rendering: str, worker: str, track: str, block: BlockId) -> Lease | None:
        with self._database.transaction() as db:
            row = db.execute(SQL["evict"], self._lease_values(rendering, worker, track, block)).fetchone()
            if row is not None:
                sqlite_plan.wait_above_evicted(db, row)
        return None if row is None else load_lease(row)

    def _lease_values(self, rendering: str, worker: str, track: str, block: BlockId) -> dict[str, Any]:
        return {**place_of(rendering, track, block), "worker": worker, "lease_s": self.lease_s}

    def heartbeat(self, lease: Lease) -> None:
        with self._database.transaction() as db:
            _move(db, lease, "heartbeat", {"lease_s": self.lease_s})

    def done(self, lease: Lease, result: JobResult) -> None:
        with self._database.transaction() as db:
            row = _move(db, lease, "done", result_row(result))
            self._open_above(db, row)

    def _open_above(self, db: sqlite3.Connection, row: sqlite3.Row) -> None:
        sqlite_plan.open_above(db, row)

    def fail(self, lease: Lease, reason: Message) -> State:
        with self._database.transaction() as db:
            row = _move(db, lease, "fail", {"max_attempts": MAX_ATTEMPTS, "reason": dump_text(reason)})
        return State(row["state"])

    def release(self, lease: Lease) -> None:
        with self._database.transaction() as db:
            _move(db, lease, "release", {})

    def expire(self, rendering: str, workers: Iterable[str]) -> int:
        with self._database.transaction() as db:
            values = [{"rendering": rendering, "worker": worker, "max_expiries": MAX_EXPIRIES} for worker in set(workers)]
            return sum(db.execute(SQL["expire_worker"], each).rowcount for each in values)

    # -- queries ----------------------------------------------------------------------------------------------------------------

    def jobs(self, rendering: str, track: str | None = None, state: State | None = None) -> Iterator[Job]:
        if state is not None and self._counts(rendering).get(state, 0) <= PAGE:
            yield from map(load_job, self._rows("in_state", {"rendering": rendering, "track": track, "state": state}))
            return
        page = "page" if track is None else "page_of_track"
        after: dict[str, Any] = {"track": track or "", "z": -1, "morton": 0, "x": 0, "y": 0}
        while rows := self._rows(page, {"rendering": rendering, "state": state, "page": PAGE, **after}):
            yield from map(load_job, rows)
            after = {name: rows[-1][name] for name in after}

    def job(self, rendering: str, track: str, block: BlockId) -> Job | None:
        rows = self._rows("job", place_of(rendering, track, block))
        return load_job(rows[0]) if rows else None

    def jobs_below(self, rendering: str, track: str, block: BlockId) -> list[Job]:
        return [load_job(row) for row in self._rows("below", place_of(rendering, track, block))]

    def _rows(self, statement: str, values: dict[str, Any]) -> list[sqlite3.Row]:
        with self._database.reading() as db:
            return db.execute(SQL[statement], values).fetchall()

    def clock_s(self) -> float:
        with self._database.reading() as db:
            return float(db.execute(f"SELECT {NOW}").fetchone()[0])

    def has_open_jobs(self, rendering: str) -> bool:
        with self._database.reading() as db:
            return db.execute(SQL["any_leasable"], {"rendering": rendering}).fetchone() is not None

    def count_jobs(self, rendering: str) -> dict[State, int]:
        with self._database.reading() as db:
            sqlite_plan.check_rendering(db, rendering)
        found = self._counts(rendering)
        return {state: found.get(state, 0) for state in State}

    def _counts(self, rendering: str) -> dict[str, int]:
        return {row["state"]: row["jobs"] for row in self._rows("counts", {"rendering": rendering})}


def _move(db: sqlite3.Connection, lease: Lease, statement: str, values: dict[str, Any]) -> sqlite3.Row:
    """Executes a statement on a leased job and returns the job; raises StaleFence when the lease is no longer held."""
    place = {**place_of(lease.rendering, lease.track, lease.block), "fence": lease.fence, "worker": lease.worker}
    row: sqlite3.Row | None = db.execute(SQL[statement], {**place, **values}).fetchone()
    if row is None:
        raise StaleFence(
            f"job {lease.track} {lease.block}: the lease of {lease.worker} (fence {lease.fence}) is no longer held; {_holder(db, place)}"
        )
    return row


def _holder(db: sqlite3.Connection, place: dict[str, Any]) -> str:
    row = db.execute(SQL["job"], place).fetchone()
    if row is None:
        return "the job no longer exists"
    worker = f", leased by {row['worker']}" if row["worker"] else ""
    return f"the job is {row['state']} with fence {row['fence']}{worker}"
