"""The catalogue in one SQLite file: scenes, assets, renderings. Jobs, operations and accounts are in files of their own."""

import json
import os
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Self

from map3d.catalogue import codec
from map3d.catalogue.contract import LEASE_S
from map3d.catalogue.records import AssetRecord, RenderingRecord, SceneCrs, SceneRecord
from map3d.catalogue.sqlite_accounts import ACCOUNT_SCHEMA, SqliteAccounts
from map3d.catalogue.sqlite_job_table import JOB_COUNTS, JOB_NEXT, JOB_ORDER, JOB_SCHEMA
from map3d.catalogue.sqlite_operations import OPERATION_SCHEMA, SqliteOperations
from map3d.database import BUSY_TIMEOUT_S, Database
from map3d.errors import AlreadyExists, BadRequest, NotFound
from map3d.geometry.frames import PinnedFrame
from map3d.types import Layer, Vec3, check_name

VERSION: Final = 8
REMOVE_BATCH: Final = 20_000
"""Jobs that one transaction removes."""
_REMOVE_JOBS: Final = "DELETE FROM job WHERE rowid IN (SELECT rowid FROM job WHERE rendering = ? LIMIT ?)"

_REMOVED: Final = "CREATE TABLE removed_rendering(name TEXT PRIMARY KEY, content_version INTEGER NOT NULL)"

_JOB_NEXT_3: Final = "CREATE INDEX job_next ON job(rendering, state, attempts + expiries, z, track, morton)"

_SCHEMA: Final = (
    """
CREATE TABLE scene(name TEXT PRIMARY KEY, title TEXT NOT NULL, attribution TEXT NOT NULL, crs TEXT, origin TEXT, options TEXT NOT NULL, built TEXT);
CREATE TABLE asset(scene TEXT NOT NULL REFERENCES scene(name), name TEXT NOT NULL, source TEXT NOT NULL, format TEXT NOT NULL,
  digest TEXT NOT NULL, source_digest TEXT NOT NULL, report TEXT NOT NULL, PRIMARY KEY(scene, name));
CREATE TABLE rendering(name TEXT PRIMARY KEY, scene TEXT NOT NULL REFERENCES scene(name), title TEXT NOT NULL, attribution TEXT NOT NULL,
  res_m REAL NOT NULL, passes TEXT NOT NULL, frames TEXT NOT NULL, box TEXT NOT NULL, options TEXT NOT NULL,
  content_version INTEGER NOT NULL, announced_version INTEGER NOT NULL, planning INTEGER NOT NULL DEFAULT 0);
"""
    + f"{_REMOVED};{JOB_SCHEMA}{OPERATION_SCHEMA}{ACCOUNT_SCHEMA}"
)
_MIGRATIONS: Final = {
    3: f"ALTER TABLE job ADD COLUMN expiries INTEGER NOT NULL DEFAULT 0; DROP INDEX job_next; {_JOB_NEXT_3};",
    4: f"""ALTER TABLE job ADD COLUMN occupied INTEGER; ALTER TABLE rendering ADD COLUMN planning INTEGER NOT NULL DEFAULT 0;
      {_REMOVED}; {JOB_ORDER}; {JOB_COUNTS};
      INSERT INTO job_count SELECT rendering, state, count(*) FROM job GROUP BY rendering, state;""",
    5: "ALTER TABLE job ADD COLUMN leased REAL; ALTER TABLE job ADD COLUMN ended REAL;",
    6: OPERATION_SCHEMA,
    7: ACCOUNT_SCHEMA,
    8: f"ALTER TABLE job ADD COLUMN ground INTEGER NOT NULL DEFAULT 0; UPDATE job SET ground = morton; DROP INDEX job_next; {JOB_NEXT};",
}
"""Version → statements that lead to it from the version before."""


class SqliteCatalogue(SqliteOperations, SqliteAccounts):
    """Implements `Catalogue`; migrates an older file. A new one is for its owner alone, since it has hashes of passwords."""

    def __init__(self, path: Path, *, lease_s: float = LEASE_S, wait_s: float | None = None) -> None:
        with suppress(OSError):  # a file that exists stays as it is; SQLite names other reasons
            os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
        super().__init__(Database(path, _SCHEMA, VERSION, _MIGRATIONS, BUSY_TIMEOUT_S if wait_s is None else wait_s), lease_s)

    def close(self) -> None:
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def create_scene(self, scene: SceneRecord) -> None:
        check_name(scene.name, "scene")
        row = (
            scene.name,
            scene.title,
            scene.attribution,
            codec.dump_crs(scene.crs),
            codec.dump_or_none(scene.origin),
            json.dumps(dict(scene.options)),
            scene.built,
        )
        with self._database.transaction() as db:
            if db.execute("INSERT OR IGNORE INTO scene VALUES (?, ?, ?, ?, ?, ?, ?)", row).rowcount == 0:
                raise AlreadyExists(f"scene {scene.name}: exists already; choose another name, or add files to it with map3d add-files")

    def scene(self, name: str) -> SceneRecord:
        with self._database.reading() as db:
            return _scene(db, name)

    def scenes(self) -> list[SceneRecord]:
        with self._database.reading() as db:
            return [codec.load_scene(row) for row in db.execute("SELECT * FROM scene ORDER BY name")]

    def pin_scene(self, name: str, crs: SceneCrs | None = None, origin: Vec3 | None = None) -> SceneRecord:
        with self._database.transaction() as db:
            before = _scene(db, name)
            empty = db.execute("SELECT 1 FROM asset WHERE scene = ?", (name,)).fetchone() is None
            pinned = codec.pinned(before, crs, origin, empty)
            values = (codec.dump_crs(pinned.crs), codec.dump_or_none(pinned.origin), name)
            db.execute("UPDATE scene SET crs = ?, origin = ? WHERE name = ?", values)
            return _scene(db, name)

    def set_built(self, name: str, digest: str) -> None:
        with self._database.transaction() as db:
            db.execute("UPDATE scene SET built = ? WHERE name = ?", (digest, name))

    def set_scene_options(self, name: str, options: Mapping[str, Any]) -> None:
        with self._database.transaction() as db:
            _scene(db, name)
            db.execute("UPDATE scene SET options = ? WHERE name = ?", (json.dumps(dict(options)), name))

    def put_asset(self, asset: AssetRecord) -> None:
        check_name(asset.name, "asset")
        row = (asset.scene, asset.name, asset.source, asset.format, asset.digest, asset.source_digest, json.dumps(dict(asset.report)))
        with self._database.transaction() as db:
            _scene(db, asset.scene)
            db.execute("INSERT OR REPLACE INTO asset VALUES (?, ?, ?, ?, ?, ?, ?)", row)

    def assets(self, scene: str) -> list[AssetRecord]:
        with self._database.reading() as db:
            _scene(db, scene)
            return [codec.load_asset(row) for row in db.execute("SELECT * FROM asset WHERE scene = ? ORDER BY name", (scene,))]

    def remove_asset(self, scene: str, name: str) -> None:
        with self._database.transaction() as db:
            _scene(db, scene)
            if db.execute("DELETE FROM asset WHERE scene = ? AND name = ?", (scene, name)).rowcount == 0:
                names = [row[0] for row in db.execute("SELECT name FROM asset WHERE scene = ? ORDER BY name LIMIT 21", (scene,))]
                raise NotFound(f"scene {scene}: no asset {name!r}; existing assets: {codec.list_names(names)}")

    def remove_scene(self, name: str) -> None:
        with self._database.transaction() as db:
            _scene(db, name)
            renderings = [row[0] for row in db.execute("SELECT name FROM rendering WHERE scene = ? ORDER BY name", (name,))]
            if renderings:
                raise BadRequest(f"scene {name}: has renderings ({', '.join(renderings)}); remove them first with map3d remove-rendering")
            db.execute("DELETE FROM asset WHERE scene = ?", (name,))
            db.execute("DELETE FROM scene WHERE name = ?", (name,))

    def create_rendering(self, rendering: RenderingRecord) -> None:
        check_name(rendering.name, "rendering")
        with self._database.transaction() as db:
            _scene(db, rendering.scene)
            removed = db.execute("SELECT content_version FROM removed_rendering WHERE name = ?", (rendering.name,)).fetchone()
            version = max(rendering.content_version, removed[0] + 1 if removed else 0)
            row = codec.dump_rendering(replace(rendering, content_version=version))
            if db.execute("INSERT OR IGNORE INTO rendering VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row).rowcount == 0:
                raise AlreadyExists(f"rendering {rendering.name}: exists already; choose another name, or use --regrid to replace its frames")

    def rendering(self, name: str) -> RenderingRecord:
        with self._database.reading() as db:
            return _rendering(db, name)

    def renderings(self, scene: str | None = None) -> list[RenderingRecord]:
        with self._database.reading() as db:
            rows = db.execute("SELECT * FROM rendering WHERE ?1 IS NULL OR scene = ?1 ORDER BY name", (scene,))
            return [codec.load_rendering(row) for row in rows]

    def regrid(self, rendering: RenderingRecord) -> RenderingRecord:
        with self._database.transaction() as db:
            before = _rendering(db, rendering.name)
            db.execute("DELETE FROM job WHERE rendering = ?", (rendering.name,))
            db.execute("DELETE FROM rendering WHERE name = ?", (rendering.name,))
            after = codec.with_versions(rendering, before.content_version + 1, before.announced_version)
            row = codec.dump_rendering(after)
            db.execute("INSERT INTO rendering VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
            return after

    def add_frames(self, name: str, frames: Sequence[PinnedFrame]) -> RenderingRecord:
        with self._database.transaction() as db:
            before = _rendering(db, name)
            if duplicates := {frame.id for frame in before.frames} & {frame.id for frame in frames}:
                raise AlreadyExists(f"rendering {name}: view {', '.join(sorted(duplicates))} exists already")
            after = replace(before, frames=(*before.frames, *frames))
            db.execute("UPDATE rendering SET frames = ? WHERE name = ?", (codec.dump_frames(after.frames), name))
            return after

    def add_pass(self, name: str, layers: Sequence[Layer]) -> RenderingRecord:
        with self._database.transaction() as db:
            before = _rendering(db, name)
            if duplicates := {layer.name for layer in before.layers} & {layer.name for layer in layers}:
                raise AlreadyExists(f"rendering {name}: layer {', '.join(sorted(duplicates))} exists already")
            after = replace(before, passes=(*before.passes, tuple(layers)))
            db.execute("UPDATE rendering SET passes = ? WHERE name = ?", (codec.dump_passes(after.passes), name))
            return after

    def describe_rendering(self, name: str, title: str, attribution: str, options: Mapping[str, Any]) -> RenderingRecord:
        with self._database.transaction() as db:
            _rendering(db, name)
            values = (title, attribution, json.dumps(dict(options)), name)
            db.execute("UPDATE rendering SET title = ?, attribution = ?, options = ? WHERE name = ?", values)
            return _rendering(db, name)

    def announce(self, name: str, version: int) -> None:
        with self._database.transaction() as db:
            db.execute("UPDATE rendering SET announced_version = max(announced_version, ?) WHERE name = ?", (version, name))

    def remove_rendering(self, name: str) -> None:
        removed = REMOVE_BATCH
        while removed == REMOVE_BATCH:
            with self._database.transaction() as db:
                version = _rendering(db, name).content_version
                removed = db.execute(_REMOVE_JOBS, (name, REMOVE_BATCH)).rowcount
                if removed < REMOVE_BATCH:
                    db.execute("INSERT OR REPLACE INTO removed_rendering VALUES (?, ?)", (name, version))
                    db.execute("DELETE FROM rendering WHERE name = ?", (name,))
                    db.execute("DELETE FROM job_count WHERE rendering = ?", (name,))


def _scene(db: sqlite3.Connection, name: str) -> SceneRecord:
    row = db.execute("SELECT * FROM scene WHERE name = ?", (name,)).fetchone()
    if row is None:
        raise NotFound(f"no scene {name!r}; existing scenes: {_names(db, 'SELECT name FROM scene ORDER BY name LIMIT 21')}")
    return codec.load_scene(row)


def _rendering(db: sqlite3.Connection, name: str) -> RenderingRecord:
    row = db.execute("SELECT * FROM rendering WHERE name = ?", (name,)).fetchone()
    if row is None:
        raise NotFound(f"no rendering {name!r}; existing renderings: {_names(db, 'SELECT name FROM rendering ORDER BY name LIMIT 21')}")
    return codec.load_rendering(row)


def _names(db: sqlite3.Connection, query: str) -> str:
    return codec.list_names([row[0] for row in db.execute(query)])
