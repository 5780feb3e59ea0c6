"""Search index and attribute columns of registries, built on first request and again after a change, in private SQLite files.

The files hold what a published folder has, so that a request for one page of a large index takes no memory for the others.
"""

import sqlite3
from collections import OrderedDict
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Lock
from typing import Final

from map3d.registry import Registry
from map3d.registry.documents import Document

FileState = tuple[tuple[int, int, int], ...]
"""(inode, time of change, size) of the database and its write-ahead log."""

Build = Callable[[Registry], Iterator[Document]]

_MAX_OPEN: Final = 8


class _Documents:
    """The documents of one registry by path."""

    def __init__(self, path: Path, build: Build) -> None:
        self._lock = Lock()
        self._db = sqlite3.connect("", isolation_level=None, check_same_thread=False)  # a private file that SQLite removes
        self._db.execute("CREATE TABLE document(path TEXT PRIMARY KEY, bytes BLOB) WITHOUT ROWID")
        with Registry(path) as registry:
            self._db.execute("BEGIN")
            self._db.executemany("INSERT OR REPLACE INTO document VALUES (?, ?)", build(registry))
            self._db.execute("COMMIT")

    def get(self, name: str) -> bytes | None:
        with self._lock:
            row = self._db.execute("SELECT bytes FROM document WHERE path = ?", (name,)).fetchone()
        return None if row is None else bytes(row[0])


class ObjectDocuments:
    """Keeps the documents of the registries used last. Threads may share it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._building: dict[tuple[Path, Build], Lock] = {}
        self._known: OrderedDict[tuple[Path, Build], tuple[FileState, _Documents]] = OrderedDict()

    def get(self, path: Path, build: Build, name: str) -> bytes | None:
        """Returns a document of the registry at `path`; None if `build` yields no document of this name. Other requests wait while it builds."""
        key = (path, build)
        with self._lock:
            building = self._building.setdefault(key, Lock())
        with building:
            state = _file_state(path)
            found = self._known.get(key)
            if found is None or found[0] != state:
                found = (state, _Documents(path, build))
        with self._lock:
            self._known[key] = found
            self._known.move_to_end(key)
            if len(self._known) > _MAX_OPEN:
                self._known.popitem(last=False)
        return found[1].get(name)


def _file_state(path: Path) -> FileState:
    """Returns a value that differs after each change of the registry."""
    log = path.with_name(path.name + "-wal")
    return tuple((stat.st_ino, stat.st_mtime_ns, stat.st_size) for stat in (one.stat() for one in (path, log) if one.is_file()) if stat.st_size)
