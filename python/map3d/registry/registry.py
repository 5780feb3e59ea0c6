"""registry.sqlite of a scene: assigns ids that survive re-imports, and returns objects by shard, by column and for searching.

`object.id` is AUTOINCREMENT: an id is never given to another object. An object is identified by asset, name and, for duplicate names, its occurrence.
Objects that a re-import no longer contains, and those of removed assets, stay with present = 0, so that they get their id back if they return.
"""

import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from map3d.database import Database
from map3d.errors import LimitExceeded
from map3d.registry.column_documents import column_documents
from map3d.registry.columns import attribute_index
from map3d.registry.documents import ATTRIBUTES, SHARDS, Document, dump_document
from map3d.registry.object_boxes import include_children
from map3d.registry.registered_objects import NewObject, ObjectKind, RegisteredAsset, RegisteredObject, plain_attributes
from map3d.registry.search_index import search_documents
from map3d.types import OBJECTS_PER_SHARD, Box

_PAGE: Final = 4096
SCENE_ASSET: Final = "_scene"
"""Asset name of the scene's own objects, such as its ground plane. Real assets cannot have this name."""

VERSION: Final = 1
MAX_ID: Final = 0xFFFFFFFF
_SCHEMA: Final = """
CREATE TABLE object(id INTEGER PRIMARY KEY AUTOINCREMENT, asset TEXT NOT NULL, name TEXT NOT NULL, occurrence INTEGER NOT NULL,
  class TEXT NOT NULL, parent INTEGER, lod TEXT, attributes TEXT NOT NULL, present INTEGER NOT NULL,
  x0 REAL, y0 REAL, z0 REAL, x1 REAL, y1 REAL, z1 REAL, UNIQUE(asset, name, occurrence));
CREATE INDEX object_asset ON object(asset, present)
"""

_UPSERT: Final = """INSERT INTO object(asset, name, occurrence, class, lod, attributes, present, x0, y0, z0, x1, y1, z1)
  VALUES (:asset, :name, :occurrence, :class, :lod, :attributes, 1, :x0, :y0, :z0, :x1, :y1, :z1)
  ON CONFLICT(asset, name, occurrence) DO UPDATE SET class = excluded.class, lod = excluded.lod, attributes = excluded.attributes, present = 1,
    parent = NULL, x0 = excluded.x0, y0 = excluded.y0, z0 = excluded.z0, x1 = excluded.x1, y1 = excluded.y1, z1 = excluded.z1
  RETURNING id"""

_RETIRE: Final = """UPDATE object SET present = 0, class = '', parent = NULL, lod = NULL, attributes = '{}',
  x0 = NULL, y0 = NULL, z0 = NULL, x1 = NULL, y1 = NULL, z1 = NULL WHERE asset = ?"""

_CHILDREN_OF: Final = """SELECT parent, id FROM object WHERE present AND asset IN (SELECT DISTINCT asset FROM object WHERE id BETWEEN ? AND ?)
  AND parent BETWEEN ? AND ? ORDER BY parent, id"""
"""The children of a range of objects; they are of the same asset as their parents, which has an index."""


class Registry:
    """Threads and processes may share it."""

    def __init__(self, path: Path) -> None:
        """Opens the file, or creates it."""
        self._database = Database(path, _SCHEMA, VERSION)

    def put_asset(self, asset: str, objects: Sequence[NewObject]) -> NDArray[np.uint32]:
        """Replaces the objects of an asset in one transaction and returns their ids, in order. Raises LimitExceeded."""
        seen: Counter[str] = Counter()
        ids = np.zeros(len(objects), dtype=np.uint32)
        with self._database.transaction() as db:
            db.execute("UPDATE object SET present = 0 WHERE asset = ?", (asset,))
            for index, item in enumerate(objects):
                (number,) = db.execute(_UPSERT, _row(asset, item, seen[item.name])).fetchone()
                if number > MAX_ID:
                    raise LimitExceeded(
                        f"asset {asset}: object {index} needs id {number}, but ids end at {MAX_ID} and stay with their objects; start a new scene"
                    )
                seen[item.name] += 1
                ids[index] = number
            parents = [(int(ids[item.parent]), int(ids[index])) for index, item in enumerate(objects) if item.parent is not None]
            db.executemany("UPDATE object SET parent = ? WHERE id = ?", parents)
            _extend_parent_boxes(db, asset)
        return ids

    def set_boxes(self, asset: str, boxes: Mapping[int, Box | None], absent: Collection[int]) -> None:
        """Sets the local boxes of an asset's objects by id, without those of their children. `absent`: ids of objects that are not part of the scene;
        all others are present."""
        with self._database.transaction() as db:
            change = "UPDATE object SET present = ?, x0 = ?, y0 = ?, z0 = ?, x1 = ?, y1 = ?, z1 = ? WHERE id = ? AND asset = ?"
            db.executemany(change, [(number not in absent, *_corners(box), number, asset) for number, box in boxes.items()])
            _extend_parent_boxes(db, asset)

    def remove_assets(self, assets: Sequence[str]) -> None:
        """Removes the objects of assets and returns the space of their attributes to the file system. Names and ids stay, so that an object that
        returns gets its id back and no other one gets it."""
        with self._database.transaction() as db:
            db.executemany(_RETIRE, [(asset,) for asset in assets])
        with self._database.autocommit() as db:
            db.execute("VACUUM")

    def get_or_create_scene_object(self, name: str, kind: str) -> int:
        """Returns the id of one of the scene's own objects. A new one is not present until `set_scene_object`."""
        with self._database.transaction() as db:
            values = (SCENE_ASSET, name, 0, kind, "{}", 0)
            db.execute("INSERT OR IGNORE INTO object(asset, name, occurrence, class, attributes, present) VALUES (?, ?, ?, ?, ?, ?)", values)
            return int(db.execute("SELECT id FROM object WHERE asset = ? AND name = ?", (SCENE_ASSET, name)).fetchone()[0])

    def set_scene_object(self, number: int, box: Box | None) -> None:
        """Sets the local box of a scene object; None removes the object."""
        with self._database.transaction() as db:
            change = "UPDATE object SET present = ?, x0 = ?, y0 = ?, z0 = ?, x1 = ?, y1 = ?, z1 = ? WHERE id = ?"
            db.execute(change, (box is not None, *_corners(box), number))

    def get(self, number: int) -> RegisteredObject | None:
        """Returns None if the object never existed or is no longer present."""
        with self._database.reading() as db:
            row = db.execute("SELECT * FROM object WHERE id = ? AND present", (number,)).fetchone()
        return None if row is None else _to_object(row)

    def ids_by_name(self, asset: str) -> dict[str, int]:
        """Returns name → id of the present objects; for duplicate names, the first."""
        with self._database.reading() as db:
            rows = db.execute("SELECT name, id FROM object WHERE asset = ? AND present ORDER BY occurrence DESC", (asset,))
            return {row["name"]: row["id"] for row in rows}

    def count(self) -> int:
        with self._database.reading() as db:
            return int(db.execute("SELECT count(*) FROM object WHERE present").fetchone()[0])

    def ids_of_classes(self, classes: Sequence[str]) -> list[int]:
        """Returns the ids of the present objects of classes, ascending."""
        query = f"SELECT id FROM object WHERE present AND class IN ({','.join('?' * len(classes))}) ORDER BY id"
        with self._database.reading() as db:
            return [int(row["id"]) for row in db.execute(query, tuple(classes))]

    def union_box(self, without: Sequence[str]) -> Box | None:
        """Returns the box of all present objects, without those of some classes; None if there are none with a box."""
        query = f"""SELECT min(x0) AS x0, min(y0) AS y0, min(z0) AS z0, max(x1) AS x1, max(y1) AS y1, max(z1) AS z1 FROM object
          WHERE present AND class NOT IN ({",".join("?" * len(without))})"""
        with self._database.reading() as db:
            return _box(db.execute(query, tuple(without)).fetchone())

    def sample_boxes(self, without: Sequence[str], step: int) -> list[tuple[float, ...]]:
        """Returns the boxes, lower and upper corners, of every `step`-th present object that is no part of another; without those of some classes."""
        query = f"""SELECT x0, y0, z0, x1, y1, z1 FROM object WHERE present AND x0 IS NOT NULL AND parent IS NULL AND id % ? = 0
          AND class NOT IN ({",".join("?" * len(without))}) ORDER BY id"""
        with self._database.reading() as db:
            return [tuple(row) for row in db.execute(query, (step, *without))]

    def objects(self) -> Iterator[RegisteredObject]:
        """Yields all present objects by id. Reads in pages, so that no transaction stays open in between."""
        last = 0
        while True:
            with self._database.reading() as db:
                rows = db.execute("SELECT * FROM object WHERE present AND id > ? ORDER BY id LIMIT ?", (last, _PAGE)).fetchall()
            if not rows:
                return
            last = rows[-1]["id"]
            yield from map(_to_object, rows)

    def asset_summaries(self) -> dict[str, RegisteredAsset]:
        """Returns count, box and levels of detail of the present objects of each asset."""
        corners = "min(x0), min(y0), min(z0), max(x1), max(y1), max(z1)"
        with self._database.reading() as db:
            rows = db.execute(f"SELECT asset, count(*), {corners} FROM object WHERE present GROUP BY asset").fetchall()
            lods: dict[str, list[str]] = {}
            for asset, lod in db.execute("SELECT DISTINCT asset, lod FROM object WHERE present AND lod IS NOT NULL ORDER BY lod"):
                lods.setdefault(asset, []).append(lod)
        return {row[0]: RegisteredAsset(row[1], _box_of(row[2:]), tuple(lods.get(row[0], ()))) for row in rows}

    def asset_kinds(self) -> dict[str, list[ObjectKind]]:
        """Returns the classes and levels of detail of the present objects of each asset, the most frequent first."""
        query = "SELECT asset, class, lod, count(*), count(x0) FROM object WHERE present GROUP BY asset, class, lod ORDER BY 4 DESC, class, lod"
        found: dict[str, list[ObjectKind]] = {}
        with self._database.reading() as db:
            for asset, kind, lod, count, drawn in db.execute(query):
                found.setdefault(asset, []).append(ObjectKind(kind, lod, count, drawn))
        return found

    def greatest_id(self) -> int:
        """Returns the greatest id that was ever assigned, 0 before the first."""
        with self._database.reading() as db:
            row = db.execute("SELECT seq FROM sqlite_sequence WHERE name = 'object'").fetchone()
        return 0 if row is None else int(row[0])

    def rows_of(self, assets: Sequence[str]) -> Iterator[tuple[int, int | None, str | None, Box | None]]:
        """Yields (id, parent, level of detail, box) of the present objects of assets."""
        with self._database.reading() as db:
            for asset in assets:
                for row in db.execute("SELECT id, parent, lod, x0, y0, z0, x1, y1, z1 FROM object WHERE asset = ? AND present", (asset,)):
                    yield row[0], row[1], row[2], _box(row)

    def shard_numbers(self) -> list[int]:
        """Returns the numbers of the shards with objects, ascending."""
        with self._database.reading() as db:
            return [row[0] for row in db.execute(f"SELECT DISTINCT id / {OBJECTS_PER_SHARD} FROM object WHERE present ORDER BY 1")]

    def shard(self, number: int) -> dict[str, Any]:
        """Returns an attribute shard (spec/manifest.md), possibly without objects."""
        first = number * OBJECTS_PER_SHARD
        between = (first, first + OBJECTS_PER_SHARD - 1)
        with self._database.reading() as db:
            children = _pairs(db.execute(_CHILDREN_OF, (*between, *between)))
        return self._shard(number, children)

    def _shard(self, number: int, children: NDArray[np.void]) -> dict[str, Any]:
        """`children`: see `_pairs`."""
        first = number * OBJECTS_PER_SHARD
        with self._database.reading() as db:
            between = (first, first + OBJECTS_PER_SHARD - 1)
            rows = db.execute("SELECT * FROM object WHERE present AND id BETWEEN ? AND ? ORDER BY id", between).fetchall()
        objects = {str(row["id"]): _to_object(row).to_json() for row in rows}
        for parent, child in children.tolist():
            if str(parent) in objects:
                objects[str(parent)].setdefault("children", []).append(child)
        return {"map3d": "objects", "version": 1, "shard": number, "objects": objects}

    def shards(self) -> Iterator[dict[str, Any]]:
        """Returns all attribute shards with objects."""
        with self._database.reading() as db:
            children = _pairs(db.execute("SELECT parent, id FROM object WHERE present AND parent IS NOT NULL ORDER BY parent, id"))
        for number in self.shard_numbers():
            start, stop = np.searchsorted(children["parent"], [number * OBJECTS_PER_SHARD, (number + 1) * OBJECTS_PER_SHARD])
            yield self._shard(number, children[start:stop])

    def search_documents(self) -> Iterator[Document]:
        """Yields the search index (spec/manifest.md)."""
        return search_documents(self.objects())

    def attribute_index(self) -> dict[str, Any]:
        """Returns the list of attribute columns (spec/manifest.md)."""
        return attribute_index(self.objects())

    def attribute_documents(self) -> Iterator[Document]:
        yield ATTRIBUTES, dump_document(self.attribute_index())

    def column_documents(self) -> Iterator[Document]:
        """Yields the attribute columns and the list of them (spec/manifest.md)."""
        index = self.attribute_index()
        yield ATTRIBUTES, dump_document(index)
        yield from column_documents(self.objects(), self.get, [(row["of"], row["name"]) for row in index["attributes"]])

    def documents(self) -> Iterator[Document]:
        """Yields all documents of the objects: attribute shards, search index and columns."""
        for shard in self.shards():
            yield SHARDS.format(shard=shard["shard"]), dump_document(shard)
        yield from self.search_documents()
        yield from self.column_documents()

    def close(self) -> None:
        self._database.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def _pairs(rows: Iterable[Any]) -> NDArray[np.void]:
    """Returns parents and children, (N,) with the uint32 fields `parent` and `id`."""
    return np.fromiter((tuple(row) for row in rows), dtype=[("parent", np.uint32), ("id", np.uint32)])


def _row(asset: str, item: NewObject, occurrence: int) -> dict[str, Any]:
    attributes = json.dumps(plain_attributes(item.attributes), ensure_ascii=False)
    texts = {"asset": asset, "name": item.name, "occurrence": occurrence, "class": item.kind, "lod": item.lod, "attributes": attributes}
    return texts | dict(zip(("x0", "y0", "z0", "x1", "y1", "z1"), _corners(item.box), strict=True))


def _corners(box: Box | None) -> tuple[float | None, ...]:
    return (None,) * 6 if box is None else (*box[0], *box[1])


def _extend_parent_boxes(db: Any, asset: str) -> None:
    """Extends the boxes of parents by those of their children."""
    rows = db.execute("SELECT id, parent, x0, y0, z0, x1, y1, z1 FROM object WHERE asset = ? AND present", (asset,)).fetchall()
    boxes = {row["id"]: _box(row) for row in rows}
    extended = include_children(boxes, {row["id"]: row["parent"] for row in rows if row["parent"] is not None})
    changed = [(*_corners(box), number) for number, box in extended.items() if box != boxes[number]]
    db.executemany("UPDATE object SET x0 = ?, y0 = ?, z0 = ?, x1 = ?, y1 = ?, z1 = ? WHERE id = ?", changed)


def _box(row: Any) -> Box | None:
    return None if row["x0"] is None else ((row["x0"], row["y0"], row["z0"]), (row["x1"], row["y1"], row["z1"]))


def _box_of(corners: Sequence[float | None]) -> Box | None:
    x0, y0, z0, x1, y1, z1 = corners
    if x0 is None or y0 is None or z0 is None or x1 is None or y1 is None or z1 is None:
        return None
    return ((x0, y0, z0), (x1, y1, z1))


def _to_object(row: Any) -> RegisteredObject:
    texts = {"name": row["name"], "kind": row["class"], "asset": row["asset"], "lod": row["lod"]}
    return RegisteredObject(id=row["id"], parent=row["parent"], attributes=json.loads(row["attributes"]), box=_box(row), **texts)
