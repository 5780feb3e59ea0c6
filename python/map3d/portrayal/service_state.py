"""The lasting state of the service, above all object ids that are unique over all layers, as OGC 15-001r4 §10.2.1 demands.

Each scene counts its objects from 1. Its ids are divided into pages of 65,536; the first request after a build permanently assigns a page of
the service to each of them. The first scene gets the pages from 0, so that its ids stay as they are.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d.database import Database
from map3d.errors import LimitExceeded

PAGE_BITS: Final = 16
PAGES: Final = 1 << 16
VERSION: Final = 1
_SCHEMA: Final = """
CREATE TABLE page(number INTEGER PRIMARY KEY, scene TEXT NOT NULL, scene_page INTEGER NOT NULL, UNIQUE(scene, scene_page));
CREATE TABLE contents(version TEXT PRIMARY KEY, sequence INTEGER NOT NULL)
"""


class ServiceState:
    """Persistent state of the service: pages of object ids, and the sequence numbers of its contents. Threads and processes may share it."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._database = Database(path, _SCHEMA, VERSION)
        self._known: dict[str, list[int]] = {}

    def pages(self, scene: str, greatest_id: int) -> list[int]:
        """Returns the service's page for each page of a scene with ids up to `greatest_id`. Raises LimitExceeded."""
        needed = (greatest_id >> PAGE_BITS) + 1
        found = self._known.get(scene, [])
        if len(found) < needed:
            found = self._find(scene)
        if len(found) < needed:
            with self._database.transaction() as db:
                (count,) = db.execute("SELECT count(*) FROM page WHERE scene = ?", (scene,)).fetchone()
                (free,) = db.execute("SELECT coalesce(max(number) + 1, 0) FROM page").fetchone()
                if free + needed - count > PAGES:
                    raise LimitExceeded(f"scene {scene}: its {greatest_id} ids do not fit; the ids of all scenes of a workspace end at 4294967295")
                rows = [(free + k, scene, count + k) for k in range(needed - count)]
                db.executemany("INSERT INTO page VALUES (?, ?, ?)", rows)
            found = self._find(scene)
        self._known[scene] = found
        return found

    def scene_of(self, service_id: int) -> tuple[str, int] | None:
        """Returns the scene of an id and the id within it; None if no scene has the id."""
        if service_id == 0:
            return None
        with self._database.reading() as db:
            row = db.execute("SELECT scene, scene_page FROM page WHERE number = ?", (service_id >> PAGE_BITS,)).fetchone()
        return None if row is None else (row[0], row[1] << PAGE_BITS | service_id & (1 << PAGE_BITS) - 1)

    def sequence(self, version: str) -> int:
        """Returns the number of the contents of this version; contents that differ from the last ones get the next number."""
        with self._database.reading() as db:
            row = db.execute("SELECT version, sequence FROM contents ORDER BY sequence DESC LIMIT 1").fetchone()
        if row is not None and row[0] == version:
            return int(row[1])
        with self._database.transaction() as db:
            row = db.execute("SELECT version, sequence FROM contents ORDER BY sequence DESC LIMIT 1").fetchone()
            if row is not None and row[0] == version:
                return int(row[1])
            number = 1 if row is None else int(row[1]) + 1
            db.execute("INSERT OR REPLACE INTO contents VALUES (?, ?)", (version, number))
            return number

    def close(self) -> None:
        self._database.close()

    def _find(self, scene: str) -> list[int]:
        with self._database.reading() as db:
            return [row[0] for row in db.execute("SELECT number FROM page WHERE scene = ? ORDER BY scene_page", (scene,))]


def to_service_ids(ids: NDArray[np.uint32], pages: list[int]) -> NDArray[np.uint32]:
    """Returns the service's ids of a scene's; 0 stays 0."""
    if pages == list(range(len(pages))):
        return ids
    table = np.array(pages, np.uint32)
    found: NDArray[np.uint32] = table[ids >> PAGE_BITS] << np.uint32(PAGE_BITS) | ids & np.uint32((1 << PAGE_BITS) - 1)
    return np.where(ids == 0, np.uint32(0), found)


def to_service_id(number: int, pages: list[int]) -> int:
    """Returns the service's id of one id of a scene."""
    return pages[number >> PAGE_BITS] << PAGE_BITS | number & (1 << PAGE_BITS) - 1
