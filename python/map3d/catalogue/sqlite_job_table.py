"""The table of jobs in SQLite: schema and conversion of rows; jobs.sql has the statements."""

import sqlite3
from typing import Any, Final

from map3d.catalogue.codec import dump_bits, load_bits
from map3d.catalogue.records import Job, JobResult, Lease, PlannedJob
from map3d.catalogue.states import State
from map3d.messages import load_text
from map3d.types import BlockId

JOB_NEXT: Final = "CREATE INDEX job_next ON job(rendering, state, attempts + expiries, z, ground, track, morton)"
JOB_ORDER: Final = "CREATE INDEX job_order ON job(rendering, track, z, morton, x, y)"
_COUNT: Final = "INSERT INTO job_count VALUES ({row}.rendering, {row}.state, 1) ON CONFLICT DO UPDATE SET jobs = jobs + 1"
_DISCOUNT: Final = "UPDATE job_count SET jobs = jobs - 1 WHERE rendering = {row}.rendering AND state = {row}.state"
JOB_COUNTS: Final = f"""
CREATE TABLE job_count(rendering TEXT NOT NULL, state TEXT NOT NULL, jobs INTEGER NOT NULL, PRIMARY KEY(rendering, state)) WITHOUT ROWID;
CREATE TRIGGER job_added AFTER INSERT ON job BEGIN {_COUNT.format(row="new")}; END;
CREATE TRIGGER job_removed AFTER DELETE ON job BEGIN {_DISCOUNT.format(row="old")}; END;
CREATE TRIGGER job_moved AFTER UPDATE OF state ON job WHEN old.state <> new.state
  BEGIN {_DISCOUNT.format(row="old")}; {_COUNT.format(row="new")}; END
"""
"""Number of jobs by state, kept by triggers, so that nothing has to count the jobs."""

JOB_SCHEMA: Final = f"""
CREATE TABLE job(rendering TEXT NOT NULL REFERENCES rendering(name), track TEXT NOT NULL, z INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL,
  kind TEXT NOT NULL, morton INTEGER NOT NULL, key TEXT NOT NULL, parent_z INTEGER, parent_x INTEGER, parent_y INTEGER,
  state TEXT NOT NULL, attempts INTEGER NOT NULL DEFAULT 0, expiries INTEGER NOT NULL DEFAULT 0,
  fence INTEGER NOT NULL DEFAULT 0, worker TEXT, leased REAL, expires REAL, ended REAL, reason TEXT,
  version INTEGER, empty INTEGER, tiles INTEGER, base_tiles INTEGER, bytes INTEGER, seconds REAL, occupied INTEGER,
  ground INTEGER NOT NULL DEFAULT 0,
  UNIQUE(rendering, track, z, x, y));
{JOB_NEXT};
{JOB_ORDER};
CREATE INDEX job_expiry ON job(expires) WHERE state = 'leased';
CREATE INDEX job_parent ON job(rendering, track, parent_z, parent_x, parent_y);
{JOB_COUNTS};
"""

RESULT: Final = ("version", "empty", "tiles", "base_tiles", "bytes", "seconds", "occupied")
"""Columns of a job's result."""


def place_of(rendering: str, track: str, block: BlockId) -> dict[str, Any]:
    return {"rendering": rendering, "track": track, "z": block.z, "x": block.x, "y": block.y}


def planned_row(rendering: str, job: PlannedJob) -> dict[str, Any]:
    """Returns the row of a planned job without its state and fence. A reduce job waits until a sweep finds all blocks below it done."""
    above = job.parent or (None, None, None)
    row = {**place_of(rendering, job.track, job.block), "kind": job.kind, "morton": job.order, "key": job.key, "ground": job.ground}
    return row | {"parent_z": above[0], "parent_x": above[1], "parent_y": above[2]}


def result_row(result: JobResult) -> dict[str, Any]:
    return {name: getattr(result, name) for name in RESULT[:-1]} | {"occupied": dump_bits(result.occupied)}


def load_lease(row: sqlite3.Row) -> Lease:
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
        ground=row["ground"],
    )


def load_job(row: sqlite3.Row) -> Job:
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
        leased_s=row["leased"],
        ended_s=row["ended"],
        reason=load_text(row["reason"]),
        result=None if row["version"] is None else _load_result(row),
        ground=row["ground"],
    )


def _load_result(row: sqlite3.Row) -> JobResult:
    numbers = {name: row[name] for name in RESULT}
    return JobResult(**{**numbers, "empty": bool(row["empty"]), "occupied": load_bits(row["occupied"])})
