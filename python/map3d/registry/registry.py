"""registry.sqlite of a scene: gives ids that stay over re-imports, and hands objects out by shard and for searching."""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from map3d.database import Database
from map3d.errors import LimitExceeded
from map3d.registry.boxes import with_parts
from map3d.registry.columns import attribute_index, column, columns
from map3d.registry.objects import NewObject, RegisteredObject, plain_attributes
from map3d.registry.schema import MAX_ID, SCHEMA, VERSION
from map3d.types import Box

SHARD_SIZE: Final = 1024
_PAGE: Final = 4096
SCENE_ASSET: Final = "_scene"
"""Stands for objects that belong to the scene and not to an asset, such as its ground plane; no asset can have this name."""

_UPSERT: Final = """INSERT INTO object(asset, name, occurrence, class, lod, attributes, present, x0, y0, z0, x1, y1, z1)
  VALUES (:asset, :name, :occurrence, :class, :lod, :attributes, 1, :x0, :y0, :z0, :x1, :y1, :z1)
  ON CONFLICT(asset, name, occurrence) DO UPDATE SET class = excluded.class, lod = excluded.lod, attributes = excluded.attributes, present = 1,
    parent = NULL, x0 = excluded.x0, y0 = excluded.y0, z0 = excluded.z0, x1 = excluded.x1, y1 = excluded.y1, z1 = excluded.z1
  RETURNING id"""


class Registry:
    """Safe to share between threads and processes."""

    def __init__(self, path: Path) -> None:
        """Opens the file, made if absent."""
        self._database = Database(path, SCHEMA, VERSION)

    def put_asset(self, asset: str, objects: Sequence[NewObject]) -> NDArray[np.uint32]:
        """Takes the objects of an import in place of the asset's earlier ones, all or none; returns their ids, in order. Raises LimitExceeded."""
        seen: Counter[str] = Counter()
        ids = np.zeros(len(objects), dtype=np.uint32)
        with self._database.transaction() as db:
            db.execute("UPDATE object SET present = 0 WHERE asset = ?", (asset,))
            for index, item in enumerate(objects):
                (number,) = db.execute(_UPSERT, _row(asset, item, seen[item.name])).fetchone()
                if number > MAX_ID:
                    raise LimitExceeded(f"asset {asset}: object {index} would get id {number}; ids go up to {MAX_ID}, and none is ever used again")
                seen[item.name] += 1
                ids[index] = number
            parents = [(int(ids[item.parent]), int(ids[index])) for index, item in enumerate(objects) if item.parent is not None]
            db.executemany("UPDATE object SET parent = ? WHERE id = ?", parents)
            _widen_parents(db, asset)
        return ids

    def scene_object(self, name: str, kind: str) -> int:
        """The id of an object of the scene itself; made absent, see `set_scene_object`."""
        with self._database.transaction() as db:
            values = (SCENE_ASSET, name, 0, kind, "{}", 0)
            db.execute("INSERT OR IGNORE INTO object(asset, name, occurrence, class, attributes, present) VALUES (?, ?, ?, ?, ?, ?)", values)
            return int(db.execute("SELECT id FROM object WHERE asset = ? AND name = ?", (SCENE_ASSET, name)).fetchone()[0])

    def set_scene_object(self, number: int, box: Box | None) -> None:
        """Whether the scene has this object now, and where (local)."""
        with self._database.transaction() as db:
            change = "UPDATE object SET present = ?, x0 = ?, y0 = ?, z0 = ?, x1 = ?, y1 = ?, z1 = ? WHERE id = ?"
            db.execute(change, (box is not None, *_corners(box), number))

    def get(self, number: int) -> RegisteredObject | None:
        """None: no such object, or no longer there."""
        with self._database.reading() as db:
            row = db.execute("SELECT * FROM object WHERE id = ? AND present", (number,)).fetchone()
        return None if row is None else _load(row)

    def ids_of(self, asset: str) -> dict[str, int]:
        """Name → id of the objects that are there; of several with a name the first."""
        with self._database.reading() as db:
            rows = db.execute("SELECT name, id FROM object WHERE asset = ? AND present ORDER BY occurrence DESC", (asset,))
            return {row["name"]: row["id"] for row in rows}

    def count(self) -> int:
        with self._database.reading() as db:
            return int(db.execute("SELECT count(*) FROM object WHERE present").fetchone()[0])

    def objects(self) -> Iterator[RegisteredObject]:
        """All that are there, by id; read in pages, so that nothing is held in between."""
        last = 0
        while True:
            with self._database.reading() as db:
                rows = db.execute("SELECT * FROM object WHERE present AND id > ? ORDER BY id LIMIT ?", (last, _PAGE)).fetchall()
            if not rows:
                return
            last = rows[-1]["id"]
            yield from map(_load, rows)

    def shard_numbers(self) -> list[int]:
        """Of the shards that have an object, rising."""
        with self._database.reading() as db:
            return [row[0] for row in db.execute(f"SELECT DISTINCT id / {SHARD_SIZE} FROM object WHERE present ORDER BY 1")]

    def shard(self, number: int) -> dict[str, Any]:
        """The document of an attribute shard (spec/manifest.md); without objects where there are none."""
        with self._database.reading() as db:
            between = (number * SHARD_SIZE, (number + 1) * SHARD_SIZE - 1)
            rows = db.execute("SELECT * FROM object WHERE present AND id BETWEEN ? AND ? ORDER BY id", between).fetchall()
        return {"map3d": "objects", "version": 1, "shard": number, "objects": {str(row["id"]): _load(row).to_json() for row in rows}}

    def shards(self) -> Iterator[dict[str, Any]]:
        """The documents of all shards that have an object."""
        return (self.shard(number) for number in self.shard_numbers())

    def search(self) -> dict[str, Any]:
        """The document of the search index (spec/manifest.md): every object that has a box."""
        entries = [(item.label, item.id, item.box) for item in self.objects() if item.box is not None]
        entries.sort(key=lambda entry: entry[:2])
        return {"map3d": "search", "version": 1, "entries": [[number, label, _top_centre(box)] for label, number, box in entries]}

    def attribute_index(self) -> dict[str, Any]:
        """The document that lists the attributes' columns (spec/manifest.md)."""
        return attribute_index(self.objects())

    def column(self, key: str) -> dict[str, Any] | None:
        """The document of a column; None when there is none with this key."""
        return column(self.objects, key)

    def columns(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """Keys and documents of all columns that are listed."""
        return columns(self.objects)

    def close(self) -> None:
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _row(asset: str, item: NewObject, occurrence: int) -> dict[str, Any]:
    attributes = json.dumps(plain_attributes(item.attributes), ensure_ascii=False)
    texts = {"asset": asset, "name": item.name, "occurrence": occurrence, "class": item.kind, "lod": item.lod, "attributes": attributes}
    return texts | dict(zip(("x0", "y0", "z0", "x1", "y1", "z1"), _corners(item.box), strict=True))


def _corners(box: Box | None) -> tuple[float | None, ...]:
    return (None,) * 6 if box is None else (*box[0], *box[1])


def _widen_parents(db: Any, asset: str) -> None:
    """A parent's box holds its parts'."""
    rows = db.execute("SELECT id, parent, x0, y0, z0, x1, y1, z1 FROM object WHERE asset = ? AND present", (asset,)).fetchall()
    boxes = {row["id"]: _box(row) for row in rows}
    widened = with_parts(boxes, {row["id"]: row["parent"] for row in rows if row["parent"] is not None})
    changed = [(*_corners(box), number) for number, box in widened.items() if box != boxes[number]]
    db.executemany("UPDATE object SET x0 = ?, y0 = ?, z0 = ?, x1 = ?, y1 = ?, z1 = ? WHERE id = ?", changed)


def _box(row: Any) -> Box | None:
    return None if row["x0"] is None else ((row["x0"], row["y0"], row["z0"]), (row["x1"], row["y1"], row["z1"]))


def _load(row: Any) -> RegisteredObject:
    texts = {"name": row["name"], "kind": row["class"], "asset": row["asset"], "lod": row["lod"]}
    return RegisteredObject(id=row["id"], parent=row["parent"], attributes=json.loads(row["attributes"]), box=_box(row), **texts)


def _top_centre(box: Box) -> list[float]:
    (x0, y0, _), (x1, y1, z1) = box
    return [(x0 + x1) / 2, (y0 + y1) / 2, z1]
