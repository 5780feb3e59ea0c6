"""The search index (spec/manifest.md): a B-tree of small documents over the words of all labels.

An entry is an outermost object, such as a building; its parts have none, and lead to it. It is stored under the text that begins at each word of
its label, and of the other words by which it is found (identifier, kind, names of parts), so that a search for the beginning of one or several words
reads one path of the tree. Pages end where a hash of the key says so and are named by their content: a changed label changes only the pages on its
paths.
"""

import json
import re
import sqlite3
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from hashlib import sha256
from itertools import groupby, islice
from operator import itemgetter
from typing import Final, NamedTuple
from zlib import crc32

from map3d.registry.documents import SEARCH, SEARCH_PAGES, Document, dump_document, dump_json
from map3d.registry.kinds import kind_words
from map3d.registry.registered_objects import RegisteredObject
from map3d.registry.words import search_words
from map3d.types import Box

MIN_PAGE_BYTES: Final = 24 << 10
MAX_PAGE_BYTES: Final = 64 << 10
"""Entries of one page, at most. A smaller index is a single document."""
CUT_EVERY: Final = 64
"""A page that has reached its least size ends at the next key whose hash is a multiple of this number."""
MAX_WORDS: Final = 16
"""Number of words of a label that can be found by their beginning."""
MAX_OTHER_WORDS: Final = 16
"""Number of words besides the label by which an object can be found."""
MAX_PARTS: Final = 64
"""Number of objects of a family whose words are read."""
MAX_KEY: Final = 48
"""Characters of a key."""
DIGITS: Final = 2
"""Decimals of a position: centimetres."""

_HOUSE_NUMBER: Final = re.compile(r"[0-9]\w{0,2}")
"""Short words that begin with a digit. They are found only behind other words, because nearly every label has one."""


def search_documents(objects: Iterable[RegisteredObject]) -> Iterator[Document]:
    """Yields the pages of the index of all objects with a box, and finally its root."""
    with closing(sqlite3.connect("", isolation_level=None)) as db:  # a private file that SQLite removes
        db.execute("CREATE TABLE entry(key BLOB, label TEXT, id INTEGER, text TEXT)")
        size = _fill(db, objects)
        if size <= MAX_PAGE_BYTES:
            rows = db.execute("SELECT text FROM entry GROUP BY id ORDER BY label, id")
            yield SEARCH, f'{{"map3d":"search","version":1,"entries":[{",".join(text for (text,) in rows)}]}}\n'.encode()
        else:
            yield from _tree(db)


def _fill(db: sqlite3.Connection, objects: Iterable[RegisteredObject]) -> int:
    """Inserts the entries under each of their keys. Returns the size of all entries, each counted once."""
    size = 0
    entries = _outermost(db, objects)
    while batch := list(islice(entries, 4096)):
        rows = []
        for entry in batch:
            text = dump_json([entry.number, entry.label, entry.place, *([" ".join(entry.words)] if entry.words else [])])
            size += len(text.encode()) + 1
            keys = dict.fromkeys([*_keys(search_words(entry.label) if entry.keyed else []), *_keys(entry.words)])
            rows += [(key, entry.label, entry.number, text) for key in list(keys) or [b""]]
        db.execute("BEGIN")
        db.executemany("INSERT INTO entry VALUES (?, ?, ?, ?)", rows)
        db.execute("COMMIT")
    return size


@dataclass
class _Entry:
    """An outermost object. `words`: of its identifier, its kind and its parts, without those of the label. `keyed`: the label begins keys, too."""

    number: int
    label: str
    place: list[float]
    words: list[str]
    keyed: bool = True


def _outermost(db: sqlite3.Connection, objects: Iterable[RegisteredObject]) -> Iterator[_Entry]:
    """Yields the objects with a box that belong to no other, each with the words of all its parts."""
    db.execute("CREATE TABLE object(id INTEGER PRIMARY KEY, parent INTEGER, class TEXT, label TEXT, words TEXT, place TEXT)")
    boxed = ((item, item.box) for item in objects if item.box is not None)
    while batch := list(islice(boxed, 4096)):
        rows = [(item.id, item.parent, item.kind, item.label, _words_of(item), dump_json(_top_centre(box))) for item, box in batch]
        db.execute("BEGIN")
        db.executemany("INSERT INTO object VALUES (?, ?, ?, ?, ?, ?)", rows)
        db.execute("COMMIT")
    db.execute("CREATE INDEX child ON object(parent) WHERE parent IS NOT NULL")
    for root, members in groupby(db.execute(_FAMILIES), key=itemgetter(0)):
        yield _entry(root, list(islice(members, MAX_PARTS)))


_FAMILIES: Final = """WITH RECURSIVE
  outer(id) AS (SELECT id FROM object WHERE parent IS NULL OR parent NOT IN (SELECT id FROM object)),
  part(root, id) AS (SELECT parent, object.id FROM object JOIN outer ON object.parent = outer.id
    UNION ALL SELECT root, object.id FROM part JOIN object ON object.parent = part.id)
  SELECT root, class, label, words, place FROM (SELECT id AS root, id FROM outer UNION ALL SELECT root, id FROM part) JOIN object USING (id)
  ORDER BY root, id <> root, id"""


def _entry(number: int, family: Sequence[tuple[int, str, str, str, str]]) -> _Entry:
    """Returns the entry of an object. `family`: root, class, label, words and place of the object, then of its parts. The first label counts."""
    _, kind, _, own_words, place = family[0]
    labels = [label for _, _, label, _, _ in family if label]
    shown = set(search_words(labels[0])) if labels else set()
    others = " ".join([own_words, *labels[1:], *(words for _, _, _, words, _ in family[1:])])
    words = [word for word in dict.fromkeys(search_words(others)) if word not in shown][:MAX_OTHER_WORDS]
    return _Entry(number, labels[0] if labels else kind, json.loads(place), words, keyed=bool(labels))


def _words_of(item: RegisteredObject) -> str:
    """Returns the words by which an object is found besides its label."""
    return " ".join([*kind_words(item.kind, item.attributes), item.name])


def _keys(words: Sequence[str]) -> list[bytes]:
    """Returns the keys of words as UTF-16, whose bytes have the order of JavaScript's strings."""
    words = words[: 2 * MAX_WORDS]
    starts = [first for first in range(min(len(words), MAX_WORDS)) if first == 0 or not _HOUSE_NUMBER.fullmatch(words[first])]
    return [" ".join(words[first:])[:MAX_KEY].encode("utf-16-be", "surrogatepass") for first in starts]


def _top_centre(box: Box) -> list[float]:
    (x0, y0, _), (x1, y1, z1) = box
    return [round(value, DIGITS) for value in ((x0 + x1) / 2, (y0 + y1) / 2, z1)]


class _Item(NamedTuple):
    """An entry or a child page. `separator`: at most `first`, and greater than the key before it unless both are equal. `number`: an entry's id."""

    first: bytes
    last: bytes
    separator: str
    text: str
    number: int | None = None
    page: str = ""


@dataclass
class _Page:
    items: list[_Item] = field(default_factory=list)
    numbers: set[int | None] = field(default_factory=set)
    size: int = 0
    last: bytes = b""

    def add(self, item: _Item) -> bool:
        """Adds a child page, or an entry once. Returns whether the page is full."""
        self.last = item.last
        if item.number is None or item.number not in self.numbers:
            self.numbers.add(item.number)
            self.items.append(item)
            self.size += len(item.text.encode()) + 1
        return self.size >= MAX_PAGE_BYTES or (self.size >= MIN_PAGE_BYTES and crc32(item.first) % CUT_EVERY == 0)


def _tree(db: sqlite3.Connection) -> Iterator[Document]:
    """Yields the levels of the tree, leaves first."""
    level: Iterable[_Item] = _entries(db.execute("SELECT key, id, text FROM entry ORDER BY key, label, id"))
    leaves = True
    while True:
        children: list[_Item] = []
        for page in _split(level):
            data = _dump_leaf(page) if leaves else _dump_node(page.items)
            children.append(_child(page, sha256(data).hexdigest()[:16]))
            yield SEARCH_PAGES.format(page=children[-1].page), data
        if sum(len(child.text.encode()) + 1 for child in children) <= MAX_PAGE_BYTES:
            yield SEARCH, _dump_node(children)
            return
        level, leaves = children, False


def _child(page: _Page, name: str) -> _Item:
    first = page.items[0]
    return _Item(first.first, page.last, first.separator, dump_json([first.separator, name]), page=name)


def _entries(rows: Iterable[tuple[bytes, int, str]]) -> Iterator[_Item]:
    before: bytes | None = None
    for key, number, text in rows:
        yield _Item(key, key, _separator(before, key), text, number)
        before = key


def _separator(before: bytes | None, key: bytes) -> str:
    """Returns the shortest beginning of `key` that is greater than `before`; `key` if both are equal."""
    if before is None:
        return ""
    common = next((k for k in range(0, len(key), 2) if key[k : k + 2] != before[k : k + 2]), len(key))
    return key.decode("utf-16-be", "surrogatepass") if common >= len(key) else _whole(key[: common + 2], key)


def _whole(start: bytes, key: bytes) -> str:
    """Returns `start` as text, longer by half of a surrogate pair if it ends within one."""
    end = len(start) + 2 if 0xD8 <= start[-2] <= 0xDB else len(start)
    return key[:end].decode("utf-16-be", "surrogatepass")


def _split(items: Iterable[_Item]) -> Iterator[_Page]:
    page = _Page()
    for item in items:
        if page.add(item):
            yield page
            page = _Page()
    if page.items:
        yield page


def _dump_leaf(page: _Page) -> bytes:
    return f'{{"map3d":"search","version":2,"entries":[{",".join(item.text for item in page.items)}]}}\n'.encode()


def _dump_node(children: Sequence[_Item]) -> bytes:
    keys, pages = [child.separator for child in children], [child.page for child in children]
    return dump_document({"map3d": "search", "version": 2, "keys": keys, "pages": pages})
