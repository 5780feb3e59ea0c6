"""Catalogues that an older map3d wrote are migrated when they are opened."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from map3d.catalogue import JobResult, SceneRecord, State
from map3d.catalogue.sqlite import VERSION, SqliteCatalogue
from map3d.errors import UnknownVersion
from tests.catalogue.implementations import rendering

VERSION_2 = """
CREATE TABLE scene(name TEXT PRIMARY KEY, title TEXT NOT NULL, attribution TEXT NOT NULL, crs TEXT, origin TEXT, options TEXT NOT NULL, built TEXT);
CREATE TABLE asset(scene TEXT NOT NULL REFERENCES scene(name), name TEXT NOT NULL, source TEXT NOT NULL, format TEXT NOT NULL,
  digest TEXT NOT NULL, source_digest TEXT NOT NULL, report TEXT NOT NULL, PRIMARY KEY(scene, name));
CREATE TABLE rendering(name TEXT PRIMARY KEY, scene TEXT NOT NULL REFERENCES scene(name), title TEXT NOT NULL, attribution TEXT NOT NULL,
  res_m REAL NOT NULL, passes TEXT NOT NULL, frames TEXT NOT NULL, box TEXT NOT NULL, options TEXT NOT NULL,
  content_version INTEGER NOT NULL, announced_version INTEGER NOT NULL);
CREATE TABLE job(rendering TEXT NOT NULL REFERENCES rendering(name), track TEXT NOT NULL, z INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL,
  kind TEXT NOT NULL, morton INTEGER NOT NULL, key TEXT NOT NULL, parent_z INTEGER, parent_x INTEGER, parent_y INTEGER,
  state TEXT NOT NULL, attempts INTEGER NOT NULL DEFAULT 0, fence INTEGER NOT NULL DEFAULT 0, worker TEXT, expires REAL, reason TEXT,
  version INTEGER, empty INTEGER, tiles INTEGER, base_tiles INTEGER, bytes INTEGER, seconds REAL, UNIQUE(rendering, track, z, x, y));
CREATE INDEX job_next ON job(rendering, state, attempts, z, track, morton);
CREATE INDEX job_expiry ON job(expires) WHERE state = 'leased';
CREATE INDEX job_parent ON job(rendering, track, parent_z, parent_x, parent_y);
"""
VERSION_3 = """
ALTER TABLE job ADD COLUMN expiries INTEGER NOT NULL DEFAULT 0;
DROP INDEX job_next;
CREATE INDEX job_next ON job(rendering, state, attempts + expiries, z, track, morton);
"""
VERSION_4 = """
ALTER TABLE job ADD COLUMN occupied INTEGER;
ALTER TABLE rendering ADD COLUMN planning INTEGER NOT NULL DEFAULT 0;
CREATE TABLE removed_rendering(name TEXT PRIMARY KEY, content_version INTEGER NOT NULL);
CREATE INDEX job_order ON job(rendering, track, z, morton, x, y);
CREATE TABLE job_count(rendering TEXT NOT NULL, state TEXT NOT NULL, jobs INTEGER NOT NULL, PRIMARY KEY(rendering, state)) WITHOUT ROWID;
CREATE TRIGGER job_added AFTER INSERT ON job
  BEGIN INSERT INTO job_count VALUES (new.rendering, new.state, 1) ON CONFLICT DO UPDATE SET jobs = jobs + 1; END;
CREATE TRIGGER job_removed AFTER DELETE ON job
  BEGIN UPDATE job_count SET jobs = jobs - 1 WHERE rendering = old.rendering AND state = old.state; END;
CREATE TRIGGER job_moved AFTER UPDATE OF state ON job WHEN old.state <> new.state
  BEGIN UPDATE job_count SET jobs = jobs - 1 WHERE rendering = old.rendering AND state = old.state;
  INSERT INTO job_count VALUES (new.rendering, new.state, 1) ON CONFLICT DO UPDATE SET jobs = jobs + 1; END;
"""
VERSION_5 = "ALTER TABLE job ADD COLUMN leased REAL; ALTER TABLE job ADD COLUMN ended REAL;"
VERSION_6 = """
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
VERSION_7 = """
CREATE TABLE user(name TEXT PRIMARY KEY, password_hash TEXT NOT NULL, role TEXT NOT NULL, created_s REAL NOT NULL);
CREATE TABLE token(id TEXT PRIMARY KEY, user TEXT NOT NULL REFERENCES user(name), title TEXT NOT NULL, role TEXT NOT NULL,
  digest TEXT NOT NULL UNIQUE, created_s REAL NOT NULL);
"""
SCHEMAS = {2 + n: "".join((VERSION_2, VERSION_3, VERSION_4, VERSION_5, VERSION_6, VERSION_7)[: n + 1]) for n in range(6)}
JOBS = """
INSERT INTO job(rendering, track, z, x, y, kind, morton, key, parent_z, parent_x, parent_y, state, attempts, fence) VALUES
  ('town-a', '0-45', 3, 0, 0, 'base', 0, 'k', 0, 0, 0, 'todo', 2, 1048578), ('town-a', '0-45', 3, 1, 0, 'base', 1, 'k', 0, 0, 0, 'done', 1, 1048577),
  ('town-a', '0-45', 0, 0, 0, 'reduce', 0, 'r', NULL, NULL, NULL, 'waiting', 0, 1048576);
UPDATE job SET version = 1, empty = 0, tiles = 3, base_tiles = 1, bytes = 100, seconds = 0.5 WHERE state = 'done';
"""


def schema(path: Path) -> dict[str, object]:
    """Returns the columns of every table and the text of every index and trigger, without the order of columns."""
    with closing(sqlite3.connect(path)) as db:
        texts = dict(db.execute("SELECT name, sql FROM sqlite_master WHERE type IN ('index', 'trigger') AND sql IS NOT NULL"))
        tables = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {name: " ".join(sql.split()) for name, sql in texts.items()} | {
            table: {tuple(row[1:]) for row in db.execute(f"PRAGMA table_info({table})")} for table in tables
        }


@pytest.fixture(params=sorted(SCHEMAS))
def old(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A catalogue of an older version with a scene, a rendering and three jobs."""
    path, recent = tmp_path / "catalogue.sqlite", tmp_path / "recent.sqlite"
    catalogue = SqliteCatalogue(recent)
    catalogue.create_scene(SceneRecord("town"))
    catalogue.create_rendering(rendering())
    catalogue.close()
    with closing(sqlite3.connect(path)) as db:
        db.executescript(SCHEMAS[request.param])
        db.execute("ATTACH ? AS recent", (str(recent),))
        for table in ("scene", "rendering"):
            columns = ", ".join(row[1] for row in db.execute(f"PRAGMA main.table_info({table})"))
            db.execute(f"INSERT INTO main.{table} SELECT {columns} FROM recent.{table}")
        db.commit()
        db.executescript(f"{JOBS} PRAGMA user_version = {request.param};")
    return path


def test_older_catalogue_is_migrated_and_keeps_its_records_and_jobs(old: Path, tmp_path: Path) -> None:
    for _ in range(2):
        catalogue = SqliteCatalogue(old)
        above, todo, done = catalogue.jobs("town-a")
        assert (todo.attempts, todo.expiries, done.state, above.state) == (2, 0, State.DONE, State.WAITING)
        assert done.result == JobResult(version=1, empty=False, tiles=3, base_tiles=1, bytes=100, seconds=0.5, occupied=None)
        assert [job.ground for job in (above, todo, done)] == [0, 0, 1], "the Morton number, as it was leased before"
        assert catalogue.rendering("town-a") == rendering()
        counts = catalogue.count_jobs("town-a")
        assert {state: count for state, count in counts.items() if count} == {State.TODO: 1, State.DONE: 1, State.WAITING: 1}
        catalogue.close()
    SqliteCatalogue(tmp_path / "new.sqlite").close()
    assert schema(old) == schema(tmp_path / "new.sqlite")
    catalogue = SqliteCatalogue(old)
    lease = catalogue.lease("town-a", "w")
    assert lease is not None
    assert (lease.attempt, lease.block) == (3, (3, 0, 0))
    catalogue.done(lease, JobResult(1, False, occupied=(1 << 64) - 1))
    assert catalogue.count_jobs("town-a")[State.TODO] == 1, "the triggers count migrated jobs too"
    catalogue.close()


@pytest.mark.parametrize("version", [1, VERSION + 1])
def test_catalogue_of_another_version_is_refused(old: Path, version: int) -> None:
    with closing(sqlite3.connect(old)) as db:
        db.execute(f"PRAGMA user_version = {version}")
    with pytest.raises(UnknownVersion, match=rf"version {version}; this map3d reads version {VERSION}"):
        SqliteCatalogue(old)
