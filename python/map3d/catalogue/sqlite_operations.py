"""Operations in SQLite: every change is one transaction that checks the state it starts from. Times are on SQLite's clock."""

import json
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, Final

from map3d.catalogue import operation_records as rules
from map3d.catalogue.operation_contract import LOG_PAGE
from map3d.catalogue.operation_records import ENDED, REPEATABLE, UNENDED, LogLine, NewOperation, OperationLease, OperationRecord, OperationState
from map3d.catalogue.sqlite_jobs import SqliteJobs
from map3d.catalogue.states import MAX_EXPIRIES
from map3d.database import NOW
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

_EXPIRE: Final = f"""UPDATE operation SET worker = NULL, expires = NULL, fence = fence + 1, expiries = expiries + 1,
  ended = iif(cancelling OR expiries + 1 >= {MAX_EXPIRIES}, {NOW}, NULL), message = CASE WHEN cancelling THEN '{rules.CANCELLED_MESSAGE}'
    WHEN expiries + 1 >= {MAX_EXPIRIES} THEN '{rules.expiry_message(MAX_EXPIRIES)}' ELSE message END,
  state = CASE WHEN cancelling THEN '{OperationState.CANCELLED}' WHEN expiries + 1 >= {MAX_EXPIRIES} THEN '{OperationState.FAILED}'
    ELSE '{OperationState.WAITING}' END, cancelling = 0 WHERE state = '{OperationState.RUNNING}'"""
_LEASE: Final = f"""UPDATE operation SET state = '{OperationState.RUNNING}', worker = ?, fence = fence + 1, expires = {NOW} + ?,
  started = coalesce(started, {NOW}) WHERE number = (SELECT min(number) FROM operation AS waiting WHERE state = '{OperationState.WAITING}'
    AND NOT EXISTS (SELECT 1 FROM operation AS running WHERE running.scene = waiting.scene AND running.state = '{OperationState.RUNNING}'))
  RETURNING *"""
_HELD: Final = f"number = :number AND state = '{OperationState.RUNNING}' AND fence = :fence AND expires >= {NOW}"
_AGAIN: Final = "worker = NULL, expires = NULL, cancelling = 0"


class SqliteOperations(SqliteJobs):
    """The operation methods of the SQLite catalogue."""

    # -- asking -----------------------------------------------------------------------------------------------------------------

    def create_operation(self, kind: str, target: str, arguments: Mapping[str, Any], asked_by: str) -> OperationRecord:
        new = NewOperation(kind, target, arguments, asked_by)
        insert = f"""INSERT INTO operation(kind, target, scene, arguments, state, asked_by, created)
          VALUES (?, ?, ?, ?, '{OperationState.WAITING}', ?, {NOW}) RETURNING *"""
        with self._database.transaction() as db:
            row = db.execute(insert, (kind, target, _scene_of(db, new), new.arguments_json, asked_by)).fetchone()
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
        query = f"""SELECT * FROM operation WHERE (:target IS NULL OR target = :target) AND (:scene IS NULL OR scene = :scene)
          AND (:before IS NULL OR number < :before) AND state IN ({_quoted(OperationState if states is None else states)})
          ORDER BY number DESC LIMIT :limit"""
        number = None if before is None else rules.operation_number(before)
        return [_load(row) for row in self._rows(query, {"target": target, "scene": scene, "before": number, "limit": limit})]

    def cancel_operation(self, id: str) -> OperationRecord:
        with self._database.transaction() as db:
            number = _row(db, id)["number"]
            db.execute(f"{_EXPIRE} AND number = ? AND expires < {NOW}", (number,))
            change = f"state = '{OperationState.CANCELLED}', ended = {NOW}, message = '{rules.CANCELLED_MESSAGE}'"
            db.execute(f"UPDATE operation SET {change} WHERE number = ? AND state = '{OperationState.WAITING}'", (number,))
            db.execute(f"UPDATE operation SET cancelling = 1 WHERE number = ? AND state = '{OperationState.RUNNING}'", (number,))
            found = _load(_row(db, id))
        if found.state not in (OperationState.RUNNING, OperationState.CANCELLED):
            raise rules.uncancellable(found)
        return found

    def retry_operation(self, id: str) -> OperationRecord:
        change = f"{_AGAIN}, expiries = 0, stage = '', done = 0, total = 0, message = '', started = NULL, ended = NULL"
        with self._database.transaction() as db:
            before = _load(_row(db, id))
            if before.state not in REPEATABLE:
                raise rules.unretryable(before)
            db.execute(f"UPDATE operation SET state = '{OperationState.WAITING}', {change} WHERE number = ?", (int(id),))
            return _load(_row(db, id))

    # -- doing ------------------------------------------------------------------------------------------------------------------

    def lease_operation(self, worker: str) -> OperationLease | None:
        """Takes the write lock only when an operation waits or runs."""
        if not self._rows(f"SELECT 1 FROM operation WHERE state IN ({_quoted(UNENDED)}) LIMIT 1", {}):
            return None
        with self._database.transaction() as db:
            db.execute(f"{_EXPIRE} AND expires < {NOW}")
            row = db.execute(_LEASE, (worker, self.lease_s)).fetchone()
        return None if row is None else OperationLease(_load(row), worker, row["fence"])

    def heartbeat_operation(self, lease: OperationLease, stage: Message, done: int, total: int) -> bool:
        change = f"expires = {NOW} + :lease_s, stage = :stage, done = :done, total = :total"
        with self._database.transaction() as db:
            values = {**_place(lease), "lease_s": self.lease_s, "stage": dump_text(stage), "done": done, "total": total}
            row = db.execute(f"UPDATE operation SET {change} WHERE {_HELD} RETURNING cancelling", values).fetchone()
        return row is not None and not row["cancelling"]

    def append_log(self, lease: OperationLease, lines: Sequence[Message]) -> None:
        texts, half = rules.log_texts(lines), rules.MAX_LOG_LINES // 2
        with self._database.transaction() as db:
            place = _place(lease)
            row = db.execute(f"UPDATE operation SET lines = lines + :lines WHERE {_HELD} RETURNING lines", {**place, "lines": len(texts)}).fetchone()
            if row is None:
                raise _stale(lease)
            first = row["lines"] - len(texts) + 1
            numbered = [(place["number"], number, text) for number, text in enumerate(texts, first)]
            db.executemany(f"INSERT INTO operation_log VALUES (?, ?, {NOW}, ?)", numbered)
            removed = (place["number"], half, row["lines"] - half)
            db.execute("DELETE FROM operation_log WHERE operation = ? AND number > ? AND number <= ?", removed)

    def operation_log(self, id: str, after: int = 0, limit: int = LOG_PAGE) -> list[LogLine]:
        query = "SELECT * FROM operation_log WHERE operation = ? AND number > ? ORDER BY number LIMIT ?"
        with self._database.reading() as db:
            rows = db.execute(query, (_row(db, id)["number"], after, limit)).fetchall()
        return rules.with_gaps(
            [LogLine(row["number"], datetime.fromtimestamp(row["time"], UTC), load_text(row["text"]) or verbatim("")) for row in rows], after
        )

    def end_operation(self, lease: OperationLease, state: OperationState, message: Message | None = None) -> None:
        change = f"state = :state, message = :message, ended = {NOW}, {_AGAIN}"
        with self._database.transaction() as db:
            values = {**_place(lease), "state": OperationState(state), "message": dump_text(message)}
            if db.execute(f"UPDATE operation SET {change} WHERE {_HELD}", values).rowcount == 0:
                ended = "SELECT 1 FROM operation WHERE number = :number AND state = :state AND fence = :fence"
                if db.execute(ended, values).fetchone() is None:
                    raise _stale(lease)

    def release_operation(self, lease: OperationLease) -> None:
        state = f"iif(cancelling, '{OperationState.CANCELLED}', '{OperationState.WAITING}')"
        change = f"state = {state}, ended = iif(cancelling, {NOW}, NULL), message = iif(cancelling, '{rules.CANCELLED_MESSAGE}', message), {_AGAIN}"
        with self._database.transaction() as db:
            if db.execute(f"UPDATE operation SET {change} WHERE {_HELD}", _place(lease)).rowcount == 0:
                raise _stale(lease)

    def expire_operations(self, workers: Iterable[str]) -> int:
        with self._database.transaction() as db:
            return sum(db.execute(f"{_EXPIRE} AND worker = ?", (worker,)).rowcount for worker in set(workers))


def _scene_of(db: sqlite3.Connection, new: NewOperation) -> str:
    """Returns the scene of the target. Raises NotFound."""
    query = "SELECT scene FROM rendering WHERE name = ?" if new.is_on_rendering else "SELECT name FROM scene WHERE name = ?"
    row = db.execute(query, (new.target,)).fetchone()
    if row is None:
        raise NotFound(f"no {'rendering' if new.is_on_rendering else 'scene'} {new.target!r}")
    return str(row[0])


def _prune(db: sqlite3.Connection) -> None:
    """Removes all but the newest ended operations, and their logs."""
    oldest = f"SELECT number FROM operation WHERE state IN ({_quoted(ENDED)}) ORDER BY number DESC LIMIT -1 OFFSET ?"
    for (number,) in db.execute(oldest, (rules.MAX_ENDED,)).fetchall():
        db.execute("DELETE FROM operation_log WHERE operation = ?", (number,))
        db.execute("DELETE FROM operation WHERE number = ?", (number,))


def _row(db: sqlite3.Connection, id: str) -> sqlite3.Row:
    row: sqlite3.Row | None = db.execute("SELECT * FROM operation WHERE number = ?", (rules.operation_number(id),)).fetchone()
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


def _quoted(states: Iterable[OperationState]) -> str:
    return ", ".join(f"'{OperationState(state)}'" for state in states) or "NULL"


def _stale(lease: OperationLease) -> StaleFence:
    return StaleFence(f"operation {lease.operation.id}: the lease of {lease.worker} (fence {lease.fence}) is no longer held")
