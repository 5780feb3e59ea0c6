"""The search index (spec/manifest.md): a B-tree of small documents over the words of all labels.

Each label is stored under the text that begins at each of its words, so that a search for the beginning of one or several words reads one path of the
tree. Pages end where a hash of the key says so and are named by their content: a changed label changes only the pages on its paths.
"""

import re
import sqlite3
import sys
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from itertools import islice
from typing import Final, NamedTuple
from zlib import crc32

from map3d.registry.documents import SEARCH, SEARCH_PAGES, Document, dump_document, dump_json
from map3d.registry.registered_objects import RegisteredObject
from map3d.types import Box

MIN_PAGE_BYTES: Final = 24 << 10
MAX_PAGE_BYTES: Final = 64 << 10
"""Entries of one page, at most. A smaller index is a single document."""
CUT_EVERY: Final = 64
"""A page that has reached its least size ends at the next key whose hash is a multiple of this number."""
MAX_WORDS: Final = 16
"""Number of words of a label that can be found by their beginning."""
MAX_KEY: Final = 48
"""Characters of a key."""
DIGITS: Final = 2
"""Decimals of a position: centimetres."""

_ASCII_WORD: Final = re.compile(r"[0-9a-z]+")
_WORD: Final = re.compile(r"[^\W_]+")
_HOUSE_NUMBER: Final = re.compile(r"[0-9]\w{0,2}")
"""Short words that begin with a digit. They are found only behind other words, because nearly every label has one."""


def search_words(text: str) -> list[str]:
    """Returns the words of a text: letters and digits, in lower case without accents; `Straße` becomes `strasse`."""
    if text.isascii():
        return _ASCII_WORD.findall(text.lower())
    return _WORD.findall(unicodedata.normalize("NFD", text.lower().replace("ß", "ss")).translate(_marks()))


@cache
def _marks() -> dict[int, None]:
    """Returns all combining marks, for `str.translate`."""
    return {code: None for code in range(sys.maxunicode + 1) if unicodedata.category(chr(code))[0] == "M"}


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
    entries = ((item.id, item.label, item.box) for item in objects if item.box is not None)
    while batch := list(islice(entries, 4096)):
        rows = []
        for number, label, box in batch:
            text = dump_json([number, label, _top_centre(box)])
            size += len(text.encode()) + 1
            rows += [(key, label, number, text) for key in _keys(label)]
        db.execute("BEGIN")
        db.executemany("INSERT INTO entry VALUES (?, ?, ?, ?)", rows)
        db.execute("COMMIT")
    return size


def _keys(label: str) -> list[bytes]:
    """Returns the keys of a label as UTF-16, whose bytes have the order of JavaScript's strings. A label without words has an empty key."""
    words = search_words(label)[: 2 * MAX_WORDS]
    starts = [0, *(first for first in range(1, min(len(words), MAX_WORDS)) if not _HOUSE_NUMBER.fullmatch(words[first]))]
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
