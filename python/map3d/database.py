"""SQLite files used by many threads and processes: one connection per thread, write-ahead log, BEGIN IMMEDIATE, busy timeout."""

import os
import re
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from map3d.errors import StoreError, UnknownVersion

BUSY_TIMEOUT_S: Final = 60.0
NOW: Final = "((julianday('now') - 2440587.5) * 86400.0)"
"""Seconds since 1970 on the database's clock, to the millisecond, as an SQL expression."""


def read_statements(path: Path) -> dict[str, str]:
    """Returns the statements of an SQL file by name; each follows a line `-- name` or `-- name: events`. `now_s()` stands for NOW."""
    text = path.read_text(encoding="utf-8").replace("now_s()", NOW)
    parts = re.split(r"^-- ([a-z_]+)(?:: [a-z, ]+)?\n", text, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


class Connections:
    """One connection to the file at `path` per thread; a connection never crosses a fork. `connect` opens a connection in autocommit mode; `wait_s`:
    how long a transaction may wait for those of other threads."""

    def __init__(self, path: Path, connect: Callable[[], sqlite3.Connection], wait_s: float = BUSY_TIMEOUT_S) -> None:
        self.path, self._wait_s = path, wait_s
        self._connect = connect
        self._local = threading.local()
        self._opened: list[tuple[int, sqlite3.Connection]] = []
        self._lock = threading.Lock()
        self._writer = (os.getpid(), threading.Lock())

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Opens a write transaction: commits it at the end, rolls it back on any exception. Raises StoreError."""
        try:
            db = self.current()
            with self._writing():
                db.execute("BEGIN IMMEDIATE")
                try:
                    yield db
                    db.execute("COMMIT")
                except BaseException:
                    if db.in_transaction:
                        db.execute("ROLLBACK")
                    raise
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: cannot write: {error}") from error

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Lets the threads of this process write one after another: SQLite would let them poll. A fork has a lock of its own."""
        if self._writer[0] != os.getpid():
            self._writer = (os.getpid(), threading.Lock())
        lock = self._writer[1]
        if not lock.acquire(timeout=self._wait_s):
            raise sqlite3.OperationalError("database is locked")
        try:
            yield
        finally:
            lock.release()

    @contextmanager
    def reading(self) -> Iterator[sqlite3.Connection]:
        """Opens a read transaction, in which all statements see the same state. Raises StoreError."""
        with self.autocommit() as db:
            db.execute("BEGIN")
            try:
                yield db
            finally:
                if db.in_transaction:
                    db.execute("ROLLBACK")

    @contextmanager
    def autocommit(self) -> Iterator[sqlite3.Connection]:
        """Gives the connection for queries that each see the latest state. Raises StoreError."""
        try:
            yield self.current()
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: cannot read: {error}") from error

    def current(self) -> sqlite3.Connection:
        """Returns this thread's connection, opened on first use. Raises sqlite3.Error."""
        opened: tuple[int, sqlite3.Connection] | None = getattr(self._local, "opened", None)
        if opened is None or opened[0] != os.getpid():
            self._local.opened = opened = (os.getpid(), self._connect())
            with self._lock:
                self._opened.append(opened)
        return opened[1]

    def close(self) -> None:
        """Closes the connections of all threads; later calls open new ones."""
        with self._lock:
            opened, self._opened = self._opened, []
            self._local = threading.local()
        for process, connection in opened:
            if process == os.getpid():
                connection.close()


class Database(Connections):
    """A database file with `schema`, written when the file is new. An older file is brought to `version` by `migrations`: version → statements that
    lead to it from the version before. Raises UnknownVersion when that is not possible.

    Once open, it stays with this file: after the file was removed or replaced, every use raises StoreError, instead of creating an empty file or
    writing into one that no other process sees.
    """

    def __init__(self, path: Path, schema: str, version: int, migrations: Mapping[int, str] | None = None, wait_s: float = BUSY_TIMEOUT_S) -> None:
        super().__init__(path, lambda: _connect(path, wait_s), wait_s)
        self._file: tuple[int, int] | None = None
        with self.transaction() as db:
            found = int(db.execute("PRAGMA user_version").fetchone()[0])
            scripts = [schema] if found == 0 else _scripts(found, version, migrations or {})
            if scripts is None:
                raise UnknownVersion(f"{path}: version {found}; this map3d reads version {version}")
            if scripts:
                for script in scripts:
                    run_script(db, script)
                db.execute(f"PRAGMA user_version = {version}")
        self._file = _identity(path)

    def current(self) -> sqlite3.Connection:
        if self._file is not None and _identity(self.path) != self._file:
            raise sqlite3.OperationalError("the file was removed or replaced")
        return super().current()


def _identity(path: Path) -> tuple[int, int]:
    """Returns device and inode of the file. Raises sqlite3.OperationalError if it is missing."""
    try:
        stat = path.stat()
    except OSError as error:
        raise sqlite3.OperationalError("the file was removed or replaced") from error
    return stat.st_dev, stat.st_ino


def _scripts(found: int, version: int, migrations: Mapping[int, str]) -> list[str] | None:
    """Returns the migrations from version `found` to `version`, in order; None if one is missing or the file is newer."""
    steps = range(found + 1, version + 1)
    return [migrations[step] for step in steps] if found <= version and all(step in migrations for step in steps) else None


def run_script(db: sqlite3.Connection, script: str) -> None:
    """Executes statements in the current transaction, which `executescript` would commit. A trigger counts as one statement."""
    statement = ""
    for part in script.split(";"):
        statement += f"{part};"
        if sqlite3.complete_statement(statement):
            db.execute(statement)
            statement = ""


def _connect(path: Path, wait_s: float) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=wait_s, isolation_level=None, check_same_thread=False)
    try:
        connection.row_factory = sqlite3.Row
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        connection.execute("PRAGMA foreign_keys = ON")
    except BaseException:
        connection.close()
        raise
    return connection
