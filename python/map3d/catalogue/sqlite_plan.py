"""Statements that open and close jobs in SQLite: plan, sweep, retry, cancel, reopen. Each function runs in the caller's transaction."""

import sqlite3
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from map3d.catalogue.records import FENCES_PER_VERSION, PlanCounts, PlannedJob
from map3d.catalogue.sqlite_job_table import place_of, planned_row
from map3d.catalogue.states import State
from map3d.database import read_statements
from map3d.errors import NotFound
from map3d.types import BlockId

Above = set[tuple[str, int, int, int]]
"""Reduce jobs as (track, z, x, y)."""

SQL: Final = read_statements(Path(__file__).with_name("jobs.sql"))


def plan_batch(db: sqlite3.Connection, rendering: str, jobs: Iterable[PlannedJob]) -> PlanCounts:
    """Adds or changes jobs; raises the content version first when a job opens."""
    added, changed, opened, kept = [], [], [], 0
    for job in jobs:
        row = planned_row(rendering, job)
        before = db.execute(SQL["job"], row).fetchone()
        if before is None:
            added.append(row)
        elif before["key"] != job.key or before["state"] == State.CANCELLED:
            changed.append(row)
        else:
            kept += 1
            continue
        opened.append(job)
    if opened:
        db.execute(SQL["begin_plan"], {"rendering": rendering})
        fence = raise_version(db, rendering) * FENCES_PER_VERSION
        db.executemany(SQL["insert"], [{**row, "fence": fence} for row in added])
        db.executemany(SQL["change"], changed)
        wait_above(db, rendering, {(job.track, *job.parent) for job in opened if job.parent is not None})
    return PlanCounts(len(added), len(changed), kept)


def end_plan(db: sqlite3.Connection, rendering: str) -> None:
    sweep(db, rendering)
    if db.execute(SQL["any_open"], {"rendering": rendering}).fetchone() is not None:
        raise_version(db, rendering)
    db.execute(SQL["end_plan"], {"rendering": rendering})


def sweep(db: sqlite3.Connection, rendering: str) -> int:
    return db.execute(SQL["sweep"], {"rendering": rendering}).rowcount


def wait_above_evicted(db: sqlite3.Connection, row: sqlite3.Row) -> None:
    """Makes the reduce job above an evicted block wait unless it is done; no job above that one is open."""
    db.execute(SQL["wait_again_unless_done"], _place_above(row))


def open_above(db: sqlite3.Connection, row: sqlite3.Row) -> None:
    """Opens the reduce job above a done job when all blocks below it are done."""
    db.execute(SQL["open_above"], _place_above(row))


def _place_above(row: sqlite3.Row) -> dict[str, Any]:
    return {"rendering": row["rendering"], "track": row["track"], "z": row["parent_z"], "x": row["parent_x"], "y": row["parent_y"]}


def wait_above(db: sqlite3.Connection, rendering: str, above: Above) -> int:
    """Makes these reduce jobs and all above them wait for the blocks below; returns the number of jobs that did not wait."""
    moved = 0
    while above:
        places = [{"rendering": rendering, "track": track, "z": z, "x": x, "y": y} for track, z, x, y in above]
        moved += db.executemany(SQL["wait_again"], places).rowcount
        above = {_above(row) for place in places if (row := db.execute(SQL["job"], place).fetchone()) is not None and row["parent_z"] is not None}
    return moved


def _above(row: sqlite3.Row) -> tuple[str, int, int, int]:
    return row["track"], row["parent_z"], row["parent_x"], row["parent_y"]


def retry(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None) -> int:
    count = _change(db, "retry", rendering, blocks)
    if count:
        raise_version(db, rendering)
        sweep(db, rendering)
    return count


def cancel(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None) -> int:
    return _change(db, "cancel", rendering, blocks)


def reopen(db: sqlite3.Connection, rendering: str, blocks: Iterable[tuple[str, BlockId]]) -> int:
    listed = list(blocks)
    rows = [db.execute(SQL["job"], place_of(rendering, track, block)).fetchone() for track, block in listed]
    above = {_above(row) for row in rows if row is not None and row["state"] == State.DONE and row["parent_z"] is not None}
    count = _change(db, "reopen", rendering, listed)
    count += wait_above(db, rendering, above)
    if count:
        raise_version(db, rendering)
        sweep(db, rendering)
    return count


def _change(db: sqlite3.Connection, statement: str, rendering: str, blocks: Iterable[tuple[str, BlockId]] | None) -> int:
    """Executes a statement for these blocks, or for all of the rendering; returns the number of jobs that changed."""
    if blocks is None:
        return db.execute(SQL[f"{statement}_all"], {"rendering": rendering}).rowcount
    return sum(db.execute(SQL[statement], place_of(rendering, track, block)).rowcount for track, block in blocks)


def raise_version(db: sqlite3.Connection, rendering: str) -> int:
    """Increments the content version if clients may have seen it; returns it. Raises NotFound."""
    db.execute(SQL["raise_version"], {"rendering": rendering})
    row = db.execute(SQL["version"], {"rendering": rendering}).fetchone()
    if row is None:
        raise NotFound(f"no rendering {rendering!r}")
    return int(row[0])


def check_rendering(db: sqlite3.Connection, rendering: str) -> None:
    """Raises NotFound."""
    if db.execute(SQL["version"], {"rendering": rendering}).fetchone() is None:
        raise NotFound(f"no rendering {rendering!r}")
