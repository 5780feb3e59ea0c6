"""Operations in SQLite (operations.sql): every change is one transaction that checks the state it starts from. Times are on SQLite's clock."""

import json
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import operation_records as rules
from map3d.catalogue.operation_contract import LOG_PAGE
from map3d.catalogue.operation_records import LogLine, NewOperation, OperationLease, OperationRecord, OperationState
from map3d.catalogue.sqlite_jobs import SqliteJobs
from map3d.catalogue.states import MAX_EXPIRIES
from map3d.database import read_statements
from map3d.errors import NotFound, StaleFence
from map3d.messages import Message, dump_text, load_text, verbatim

OPERATION_SCHEMA: Final = """
CREATE TABLE operation(number INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, target TEXT NOT NULL, scene TEXT NOT NULL,
  arguments TEXT NOT NULL, state TEXT NOT NULL, stage TEXT NOT NULL DEFAULT '', done INTEGER NOT NULL DEFAULT 0, total INTEGER NOT NULL DEFAULT 0,
  message TEXT NOT NULL DEFAULT '', asked_by TEXT NOT NULL, created REAL NOT NULL, started REAL, ended REAL,
  worker TEXT, fence INTEGER NOT NULL DEFAULT 0, expires REAL, expiries INTEGER NOT NULL DEFAULT 0,
  cancelling INTEGER NOT NULL DEFAULT 0, lines INTEGER NOT NULL DEFAULT 0);
CREATE INDEX operation_state ON operation(state, number);
CREATE UNIQUE INDEX operation_running ON operation(scene) WHERE state = 'running';
CREATE TABLE operation_log(operation INTEGER NOT NULL, number INTEGER NOT NULL, time REAL NOT NULL, text TEXT NOT NULL,
  PRIMARY KEY(operation, number)) WITHOUT ROWID;
"""
"""The unique index keeps two operations of one scene from running at the same time."""

_SQL: Final = read_statements(Path(__file__).with_name("operations.sql"))


class SqliteOperations(SqliteJobs):
    """The operation methods of the SQLite catalogue."""

    # -- asking -----------------------------------------------------------------------------------------------------------------

    def create_operation(self, kind: str, target: str, arguments: Mapping[str, Any], asked_by: str) -> OperationRecord:
        new = NewOperation(kind, target, arguments, asked_by)
        values = {"kind": kind, "target": target, "arguments": new.arguments_json, "asked_by": asked_by}
        with self._database.transaction() as db:
            row = db.execute(_SQL["create"], {**values, "scene": _scene_of(db, new)}).fetchone()
            _prune(db)
            return _load(row)

    def operation(self, id: str) -> OperationRecord:
        with self._database.reading() as db:
            return _load(_row(db, id))

    def operations(
        self,
        target: str | None = None,
        states: Sequence[OperationState] | None = None,
        limit: int = 100,
        *,
        scene: str | None = None,
        before: str | None = None,
    ) -> list[OperationRecord]:
        number = None if before is None else rules.operation_number(before)
        values = {"target": target, "scene": scene, "before": number, "limit": limit, "states": None if states is None else json.dumps(states)}
        with self._database.reading() as db:
            return [_load(row) for row in db.execute(_SQL["operations"], values)]

    def cancel_operation(self, id: str) -> OperationRecord:
        with self._database.transaction() as db:
            place = {"number": _row(db, id)["number"], "cancelled": rules.CANCELLED_MESSAGE}
            _expire(db, number=place["number"])
            db.execute(_SQL["cancel_waiting"], place)
            db.execute(_SQL["cancel_running"], place)
            found = _load(_row(db, id))
        if found.state not in (OperationState.RUNNING, OperationState.CANCELLED):
            raise rules.uncancellable(found)
        return found

    def retry_operation(self, id: str) -> OperationRecord:
        with self._database.transaction() as db:
            before = _load(_row(db, id))
            if db.execute(_SQL["retry"], {"number": int(id)}).rowcount == 0:
                raise rules.unretryable(before)
            return _load(_row(db, id))

    # -- doing ------------------------------------------------------------------------------------------------------------------

    def lease_operation(self, worker: str) -> OperationLease | None:
        """Takes the write lock only when an operation waits or runs."""
        with self._database.reading() as db:
            if db.execute(_SQL["any_unended"]).fetchone() is None:
                return None
        with self._database.transaction() as db:
            _expire(db)
            row = db.execute(_SQL["lease"], {"worker": worker, "lease_s": self.lease_s}).fetchone()
        return None if row is None else OperationLease(_load(row), worker, row["fence"])

    def heartbeat_operation(self, lease: OperationLease, stage: Message, done: int, total: int) -> bool:
        values = {**_place(lease), "lease_s": self.lease_s, "stage": dump_text(stage), "done": done, "total": total}
        with self._database.transaction() as db:
            row = db.execute(_SQL["heartbeat"], values).fetchone()
        return row is not None and not row["cancelling"]

    def append_log(self, lease: OperationLease, lines: Sequence[Message]) -> None:
        texts, half = rules.log_texts(lines), rules.MAX_LOG_LINES // 2
        with self._database.transaction() as db:
            place = _place(lease)
            row = db.execute(_SQL["count_lines"], {**place, "lines": len(texts)}).fetchone()
            if row is None:
                raise _stale(lease)
            number, total = place["number"], row["lines"]
            first = total - len(texts) + 1
            db.executemany(_SQL["append_line"], [{"operation": number, "number": k, "text": text} for k, text in enumerate(texts, first)])
            db.execute(_SQL["remove_lines"], {"operation": number, "after": half, "until": total - half})

    def operation_log(self, id: str, after: int = 0, limit: int = LOG_PAGE) -> list[LogLine]:
        with self._database.reading() as db:
            rows = db.execute(_SQL["log"], {"number": _row(db, id)["number"], "after": after, "limit": limit}).fetchall()
        return rules.with_gaps(
            [LogLine(row["number"], datetime.fromtimestamp(row["time"], UTC), load_text(row["text"]) or verbatim("")) for row in rows], after
        )

    def end_operation(self, lease: OperationLease, state: OperationState, message: Message | None = None) -> None:
        values = {**_place(lease), "state": OperationState(state), "message": dump_text(message)}
        with self._database.transaction() as db:
            if db.execute(_SQL["end"], values).rowcount == 0 and db.execute(_SQL["has_ended"], values).fetchone() is None:
                raise _stale(lease)

    def release_operation(self, lease: OperationLease) -> None:
        with self._database.transaction() as db:
            if db.execute(_SQL["release"], {**_place(lease), "cancelled": rules.CANCELLED_MESSAGE}).rowcount == 0:
                raise _stale(lease)

    def expire_operations(self, workers: Iterable[str]) -> int:
        with self._database.transaction() as db:
            return sum(_expire(db, worker=worker) for worker in set(workers))


def _expire(db: sqlite3.Connection, number: int | None = None, worker: str | None = None) -> int:
    """Expires the leases of a worker, or all that are overdue; of one operation, or of any. Returns their number."""
    messages = {"cancelled": rules.CANCELLED_MESSAGE, "expired": rules.expiry_message(MAX_EXPIRIES)}
    return db.execute(_SQL["expire"], {"number": number, "worker": worker, "max_expiries": MAX_EXPIRIES, **messages}).rowcount


def _scene_of(db: sqlite3.Connection, new: NewOperation) -> str:
    """Returns the scene of the target. Raises NotFound."""
    row = db.execute(_SQL["scene_of_rendering" if new.is_on_rendering else "scene"], {"target": new.target}).fetchone()
    if row is None:
        raise NotFound(f"no {'rendering' if new.is_on_rendering else 'scene'} {new.target!r}")
    return str(row[0])


def _prune(db: sqlite3.Connection) -> None:
    """Removes all but the newest ended operations, and their logs."""
    oldest = [dict(row) for row in db.execute(_SQL["too_many_ended"], {"kept": rules.MAX_ENDED})]
    db.executemany(_SQL["remove_log"], oldest)
    db.executemany(_SQL["remove"], oldest)


def _row(db: sqlite3.Connection, id: str) -> sqlite3.Row:
    row: sqlite3.Row | None = db.execute(_SQL["operation"], {"number": rules.operation_number(id)}).fetchone()
    if row is None:
        raise NotFound(f"no operation {id!r}; map3d operations lists them")
    return row


def _load(row: sqlite3.Row) -> OperationRecord:
    names = ("kind", "target", "scene", "done", "total", "asked_by", "worker")
    return OperationRecord(
        id=str(row["number"]),
        arguments=json.loads(row["arguments"]),
        state=OperationState(row["state"]),
        stage=load_text(row["stage"]),
        message=load_text(row["message"]),
        cancelling=bool(row["cancelling"]),
        created=datetime.fromtimestamp(row["created"], UTC),
        started=_time(row["started"]),
        ended=_time(row["ended"]),
        **{name: row[name] for name in names},
    )


def _time(seconds: float | None) -> datetime | None:
    return None if seconds is None else datetime.fromtimestamp(seconds, UTC)


def _place(lease: OperationLease) -> dict[str, Any]:
    return {"number": int(lease.operation.id), "fence": lease.fence}


def _stale(lease: OperationLease) -> StaleFence:
    return StaleFence(f"operation {lease.operation.id}: the lease of {lease.worker} (fence {lease.fence}) is no longer held")
