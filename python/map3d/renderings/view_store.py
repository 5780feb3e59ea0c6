"""Stored images of views: what was computed once is not computed again, also after a restart, within a limit of bytes. They go with their scenes.

Files in a folder, and an index in SQLite that knows their sizes and when they were used last. The least recently used ones are removed before a new
one is written. Errors are never stored.
"""

import contextlib
import fcntl
import os
import secrets
import sqlite3
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.database import NOW, Database
from map3d.errors import BadRequest, StoreError

_INDEX: Final = "views.sqlite"
LIMIT_VARIABLE: Final = "MAP3D_VIEW_STORE_GB"
DEFAULT_GB: Final = 5.0
VERSION: Final = 2
LOCKS: Final = 1024
MARK_S: Final = 5.0
MARKS: Final = 10_000
OVERHEAD_BYTES: Final = 4096
"""Counted per image for its file and its row."""
_SCENES: Final = """
CREATE TABLE view_scene(key TEXT NOT NULL, scene TEXT NOT NULL, PRIMARY KEY(key, scene)) WITHOUT ROWID;
CREATE INDEX scene_view ON view_scene(scene)
"""
_SCHEMA: Final = f"""
CREATE TABLE view(key TEXT PRIMARY KEY, bytes INTEGER NOT NULL, used REAL NOT NULL, tick INTEGER NOT NULL) WITHOUT ROWID;
CREATE INDEX view_used ON view(tick);
CREATE TABLE total(bytes INTEGER NOT NULL, tick INTEGER NOT NULL);
INSERT INTO total VALUES (0, 0);
{_SCENES}"""


_OF_SCENE: Final = "EXISTS (SELECT 1 FROM view_scene WHERE view_scene.key = view.key AND scene = ?)"
_OF_NO_SCENE: Final = "NOT EXISTS (SELECT 1 FROM view_scene WHERE view_scene.key = view.key)"
"""Images that an older version stored: their scene is unknown; they are deleted with the first removed scene."""


def views_folder(workspace: Workspace) -> Path:
    return workspace.root / "portrayal" / "views"


def remove_views(workspace: Workspace, scene: str) -> None:
    """Removes the stored images of a scene that is no longer in the catalogue; nothing without a store. Raises StoreError."""
    folder = views_folder(workspace)
    if not (folder / _INDEX).is_file():
        return
    store = ViewStore(folder, 0)
    try:
        store.remove_scene(scene)
    finally:
        store.close()


def store_limit_bytes() -> int:
    """Raises BadRequest unless the environment variable is a number that is not negative."""
    text = os.environ.get(LIMIT_VARIABLE, str(DEFAULT_GB))
    with contextlib.suppress(ValueError):
        if (limit := float(text)) >= 0:
            return int(limit * 1e9)
    raise BadRequest(f"{LIMIT_VARIABLE}={text}: expected a number of GB")


class ViewStore:
    """Threads and processes may share it. Keys are hexadecimal."""

    def __init__(self, folder: Path, limit_bytes: int) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "locks").mkdir(exist_ok=True)
        self._folder, self.limit_bytes = folder, limit_bytes
        self._database = Database(folder / _INDEX, _SCHEMA, VERSION, {2: _SCENES})
        self._marked: dict[str, float] = {}

    def get(self, key: str) -> bytes | None:
        """Returns the image and marks it as used; None if it is not stored."""
        try:
            data = self._path(key).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            raise StoreError(f"{self._path(key)}: cannot read: {error}") from error
        self._mark_used(key)
        return data

    def put(self, key: str, data: bytes, scenes: Collection[str], is_current: Callable[[], bool] = lambda: True) -> None:
        """Stores an image of scenes, unless it is larger than an eighth of the limit. Makes room before it writes.

        `is_current` is called while no other process changes the store: an image of a scene that is removed meanwhile is either not stored, or
        removed with the scene.
        """
        cost = len(data) + OVERHEAD_BYTES
        if cost * 8 > self.limit_bytes:
            return
        path = self._path(key)
        draft = path.with_name(f".{path.name}.{secrets.token_hex(4)}.new")
        with self._database.transaction() as db:
            if not is_current():
                return
            (known,) = db.execute("SELECT count(*) FROM view WHERE key = ?", (key,)).fetchone()
            if known and path.is_file():
                return
            self._remove(db, self._least_used(db, cost))
            try:
                path.parent.mkdir(exist_ok=True)
                draft.write_bytes(data)
                draft.replace(path)
            except OSError as error:
                draft.unlink(missing_ok=True)
                raise StoreError(f"{path}: cannot write: {error}") from error
            db.executemany("INSERT OR IGNORE INTO view_scene VALUES (?, ?)", [(key, scene) for scene in scenes])
            if not known:
                db.execute("UPDATE total SET bytes = bytes + ?, tick = tick + 1", (cost,))
                db.execute(f"INSERT INTO view SELECT ?, ?, {NOW}, tick FROM total", (key, cost))

    def remove_scene(self, scene: str) -> None:
        """Removes all images that show the scene. After a kill, the same call completes the removal."""
        with self._database.transaction() as db:
            self._remove(db, list(db.execute(f"SELECT key, bytes FROM view WHERE {_OF_SCENE} OR {_OF_NO_SCENE}", (scene,))))

    def keep_scenes(self, scenes: Collection[str]) -> None:
        """Removes the images of scenes that were removed by other hosts of a shared catalogue."""
        with self._database.reading() as db:
            known = [row[0] for row in db.execute("SELECT DISTINCT scene FROM view_scene")]
        for scene in set(known) - set(scenes):
            self.remove_scene(scene)

    def used_bytes(self) -> int:
        """Returns the size of all stored images, with the overhead of each."""
        with self._database.reading() as db:
            return int(db.execute("SELECT bytes FROM total").fetchone()[0])

    @contextmanager
    def computing(self, key: str) -> Iterator[None]:
        """Holds a lock, across processes, under which one of several identical requests computes while the others wait."""
        number = int(key[:8], 16) % LOCKS
        with (self._folder / "locks" / f"{number}.lock").open("ab") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield

    def close(self) -> None:
        self._database.close()

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / key

    def _least_used(self, db: sqlite3.Connection, cost: int) -> list[tuple[str, int]]:
        """Returns the images to remove, so that `cost` bytes fit: key and size of each."""
        over = int(db.execute("SELECT bytes FROM total").fetchone()[0]) + cost - self.limit_bytes
        removed: list[tuple[str, int]] = []
        if over > 0:
            for row in db.execute("SELECT key, bytes FROM view ORDER BY tick"):
                if over <= 0:
                    break
                removed.append((row[0], row[1]))
                over -= row[1]
        return removed

    def _remove(self, db: sqlite3.Connection, images: list[tuple[str, int]]) -> None:
        for key, freed in images:
            self._path(key).unlink(missing_ok=True)
            db.execute("DELETE FROM view WHERE key = ?", (key,))
            db.execute("DELETE FROM view_scene WHERE key = ?", (key,))
            db.execute("UPDATE total SET bytes = bytes - ?", (freed,))

    def _mark_used(self, key: str) -> None:
        """Marks an image as used, at most every few seconds, because each mark is a durable write."""
        now = time.monotonic()
        if now - self._marked.get(key, -MARK_S) < MARK_S:
            return
        if len(self._marked) > MARKS:
            self._marked.clear()
        self._marked[key] = now
        with contextlib.suppress(StoreError), self._database.transaction() as db:
            db.execute("UPDATE total SET tick = tick + 1")
            db.execute(f"UPDATE view SET used = {NOW}, tick = (SELECT tick FROM total) WHERE key = ?", (key,))
