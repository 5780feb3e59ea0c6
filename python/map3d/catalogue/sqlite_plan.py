"""Statements that open and close jobs in SQLite: plan, sweep, retry, cancel, reopen. Each function runs in the caller's transaction."""

import sqlite3
from collections.abc import Iterable
from typing import Any, Final

from map3d.catalogue.records import FENCES_PER_VERSION, PlanCounts, PlannedJob
from map3d.catalogue.sqlite_job_table import ALL_BELOW_DONE, AT, place_of, planned_row, quoted
from map3d.catalogue.states import OPEN, JobEvent, State, next_state, sources
from map3d.errors import NotFound
from map3d.types import BlockId

Above = set[tuple[str, int, int, int]]
"""Reduce jobs as (track, z, x, y)."""

_INSERTED: Final = ("rendering", "track", "z", "x", "y", "kind", "morton", "key", "parent_z", "parent_x", "parent_y", "state", "fence", "ground")
_INSERT: Final = f"INSERT INTO job({', '.join(_INSERTED)}) VALUES ({', '.join(f':{name}' for name in _INSERTED)})"
_FORGET: Final = "attempts = 0, expiries = 0, worker = NULL, expires = NULL, reason = NULL"
_CHANGE: Final = f"UPDATE job SET key = :key, state = :state, ground = :ground, fence = fence + 1, {_FORGET} WHERE {AT}"
"""Increments the fence too, so that a worker that still renders the old state loses its lease."""
_TODO_OR_WAITING: Final = f"iif(kind = 'base', '{State.TODO}', '{State.WAITING}')"
_WAIT_AGAIN: Final = f"""UPDATE job SET state = '{next_state(State.DONE, JobEvent.BELOW_REOPENED)}', fence = fence + 1, {_FORGET}
  WHERE {AT} AND state IN ({quoted(set(sources(JobEvent.BELOW_REOPENED)) - {State.WAITING})})"""
_OPEN_WAITING: Final = f"""UPDATE job SET state = '{next_state(State.WAITING, JobEvent.BELOW_DONE)}'
  WHERE state = '{State.WAITING}' AND {ALL_BELOW_DONE}"""


def plan_batch(db: sqlite3.Connection, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
    """Adds or changes jobs; raises the content version first when a job opens."""
    added, changed, opened, kept = [], [], [], 0
    for job in jobs:
        row = planned_row(rendering, job)
        before = db.execute(f"SELECT key, state FROM job WHERE {AT}", row).fetchone()
        if before is None:
            added.append(row)
        elif before["key"] != job.key or before["state"] == State.CANCELLED:
            changed.append(row)
        else:
            kept += 1
            continue
        opened.append(job)
    if opened:
        db.execute("UPDATE rendering SET planning = 1 WHERE name = ?", (rendering,))
        fence = raise_version(db, rendering) * FENCES_PER_VERSION
        db.executemany(_INSERT, [{**row, "fence": fence} for row in added])
        db.executemany(_CHANGE, changed)
        wait_above(db, rendering, {(job.track, *job.parent) for job in opened if job.parent is not None})
    return PlanCounts(len(added), len(changed), kept)


def end_plan(db: sqlite3.Connection, rendering: str) -> None:
    sweep(db, rendering)
    if any_open(db, rendering):
        raise_version(db, rendering)
    db.execute("UPDATE rendering SET planning = 0 WHERE name = ? AND planning", (rendering,))


def sweep(db: sqlite3.Connection, rendering: str) -> int:
    return db.execute(f"{_OPEN_WAITING} AND rendering = ?", (rendering,)).rowcount


def wait_above_evicted(db: sqlite3.Connection, row: sqlite3.Row) -> None:
    """Makes the reduce job above an evicted block wait unless it is done; no job above that one is open."""
    place = {"rendering": row["rendering"], "track": row["track"], "z": row["parent_z"], "x": row["parent_x"], "y": row["parent_y"]}
    db.execute(f"{_WAIT_AGAIN} AND state <> '{State.DONE}'", place)


def open_above(db: sqlite3.Connection, row: sqlite3.Row) -> None:
    """Opens the reduce job above a done job when all blocks below it are done."""
    place = {"rendering": row["rendering"], "track": row["track"], "z": row["parent_z"], "x": row["parent_x"], "y": row["parent_y"]}
    db.execute(f"{_OPEN_WAITING} AND {AT}", place)


def wait_above(db: sqlite3.Connection, rendering: str, above: Above) -> int:
    """Makes these reduce jobs and all above them wait for the blocks below; returns the number of jobs that did not wait."""
    moved = 0
    while above:
        places = [{"rendering": rendering, "track": track, "z": z, "x": x, "y": y} for track, z, x, y in above]
        moved += db.executemany(_WAIT_AGAIN, places).rowcount
        rows = [
            db.execute(f"SELECT track, parent_z, parent_x, parent_y FROM job WHERE {AT} AND parent_z IS NOT NULL", at).fetchone() for at in places
        ]
        above = {tuple(row) for row in rows if row is not None}
    return moved


def retry(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None) -> int:
    change = f"state = {_TODO_OR_WAITING}, attempts = 0, expiries = 0"
    count = _change(db, rendering, blocks, change, sources(JobEvent.RETRY))
    if count:
        raise_version(db, rendering)
        sweep(db, rendering)
    return count


def cancel(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None) -> int:
    change = f"state = '{State.CANCELLED}', fence = fence + 1, {_FORGET}"
    return _change(db, rendering, blocks, change, sources(JobEvent.CANCEL))


def reopen(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]]) -> int:
    listed = list(blocks)
    change = f"state = {_TODO_OR_WAITING}, fence = fence + 1, {_FORGET}"
    above = {row for track, block in listed if (row := _done_parent(db, place_of(rendering, track, block))) is not None}
    count = _change(db, rendering, listed, change, sources(JobEvent.REOPEN))
    count += wait_above(db, rendering, above)
    if count:
        raise_version(db, rendering)
        sweep(db, rendering)
    return count


def _done_parent(db: sqlite3.Connection, place: dict[str, Any]) -> tuple[str, int, int, int] | None:
    """Returns the reduce job above a done job."""
    query = f"SELECT track, parent_z, parent_x, parent_y FROM job WHERE {AT} AND state = '{State.DONE}' AND parent_z IS NOT NULL"
    row = db.execute(query, place).fetchone()
    return None if row is None else tuple(row)


def _change(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None, change: str, states: Iterable[State]) -> int:
    """Changes all jobs in these states, or those of `blocks`; returns their number."""
    statement = f"UPDATE job SET {change} WHERE state IN ({quoted(states)})"
    if blocks is None:
        return db.execute(f"{statement} AND rendering = ?", (rendering,)).rowcount
    return sum(db.execute(f"{statement} AND {AT}", place_of(rendering, track, block)).rowcount for track, block in blocks)


def raise_version(db: sqlite3.Connection, rendering: str) -> int:
    """Increments the content version if clients may have seen it; returns it. Raises NotFound."""
    change = "UPDATE rendering SET content_version = announced_version + 1 WHERE name = ? AND announced_version >= content_version"
    db.execute(change, (rendering,))
    row = db.execute("SELECT content_version FROM rendering WHERE name = ?", (rendering,)).fetchone()
    if row is None:
        raise NotFound(f"no rendering {rendering!r}")
    return int(row[0])


def check_rendering(db: sqlite3.Connection, rendering: str) -> None:
    """Raises NotFound."""
    if db.execute("SELECT 1 FROM rendering WHERE name = ?", (rendering,)).fetchone() is None:
        raise NotFound(f"no rendering {rendering!r}")


def any_open(db: sqlite3.Connection, rendering: str, states: Iterable[State] = OPEN) -> bool:
    query = f"SELECT 1 FROM job WHERE rendering = ? AND state IN ({quoted(states)}) LIMIT 1"
    return db.execute(query, (rendering,)).fetchone() is not None
