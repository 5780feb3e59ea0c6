"""Attributes by column (spec/manifest.md): the values of one attribute for all objects, for colouring and filtering.

A column of few objects is one document. A larger one is divided into shards by object id, with a summary that suffices to choose classes and colours.
One pass over the objects writes all columns.
"""

import re
from array import array
from collections import Counter, OrderedDict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import Any, Final

from map3d.registry.columns import OF_ATTRIBUTES, ColumnId, column_key, object_values
from map3d.registry.documents import COLUMN_SHARDS, COLUMNS, Document, dump_document
from map3d.registry.registered_objects import Attribute, RegisteredObject

OBJECTS_PER_COLUMN_SHARD: Final = 4096
MAX_WHOLE_COLUMN: Final = 4096
"""A column of at most this number of objects is one document."""
MAX_LISTED_VALUES: Final = 100
"""A summary lists the most frequent values, at most this number of them."""
MAX_COUNTED_VALUES: Final = 10_000
"""Values are counted that are among the first values of a column, at most this number of different ones."""
SAMPLED_NUMBERS: Final = 1001
"""A summary has this number of evenly spaced values of the sorted numbers."""
_INHERITED_IN_MEMORY: Final = 10_000

_NUMBER: Final = re.compile(r"\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?\s*", re.ASCII)

Find = Callable[[int], RegisteredObject | None]
"""Returns an object by id."""


def column_documents(objects: Iterable[RegisteredObject], find: Find, columns: Collection[ColumnId]) -> Iterator[Document]:
    """Yields the documents of columns. `objects`: by ascending id. Objects without a value inherit that of the nearest ancestor."""
    writers = {column: _ColumnWriter(*column) for column in columns}
    inherited = _InheritedValues(find)
    for item in objects:
        for column, value in (inherited.of(item) | dict(object_values(item))).items():
            if column in writers:
                yield from writers[column].add(item.id, value)
    for writer in writers.values():
        yield from writer.finish()


class _InheritedValues:
    """The values of ancestors, kept for the objects whose parent was seen recently."""

    def __init__(self, find: Find) -> None:
        self._find = find
        self._known: OrderedDict[int, Mapping[ColumnId, Attribute]] = OrderedDict()

    def of(self, item: RegisteredObject) -> dict[ColumnId, Attribute]:
        """Returns the attributes of all ancestors; those of nearer ones win."""
        return {} if item.parent is None else dict(self._of_parent(item.parent))

    def _of_parent(self, number: int) -> Mapping[ColumnId, Attribute]:
        known = self._known.get(number)
        if known is None:
            known = self._known[number] = self._collect(number)
            if len(self._known) > _INHERITED_IN_MEMORY:
                self._known.popitem(last=False)
        return known

    def _collect(self, number: int | None) -> Mapping[ColumnId, Attribute]:
        values: dict[ColumnId, Attribute] = {}
        seen: set[int] = set()
        while number is not None and number not in seen:
            seen.add(number)
            item = self._find(number)
            if item is None:
                break
            values = {column: value for column, value in object_values(item) if column[0] == OF_ATTRIBUTES} | values
            number = item.parent
        return values


class _ColumnWriter:
    """Holds back the values of one shard, and those of the whole column while they are few."""

    def __init__(self, of: str, name: str) -> None:
        self._of, self._name, self._key = of, name, column_key(of, name)
        self._ids: list[int] = []
        self._values: list[Attribute] = []
        self._shards: list[int] = []
        self._summary = _Summary()

    def add(self, number: int, value: Attribute) -> Iterator[Document]:
        """Adds a value. Yields the shards that are complete."""
        if self._shards and number // OBJECTS_PER_COLUMN_SHARD != self._shards[-1]:
            yield from self._flush()
        self._ids.append(number)
        self._values.append(value)
        self._summary.count(value)
        if self._shards:
            self._open_shard()
        elif len(self._ids) > MAX_WHOLE_COLUMN:
            yield from self._divide()

    def finish(self) -> Iterator[Document]:
        """Yields the last shard and the summary, or the whole column."""
        if not self._shards:
            yield COLUMNS.format(column=self._key), self._dump(1, {"ids": self._ids, "values": self._values})
            return
        yield from self._flush()
        summary = {"shard_size": OBJECTS_PER_COLUMN_SHARD, "shards": self._shards, **self._summary.to_json()}
        yield COLUMNS.format(column=self._key), self._dump(2, summary)

    def _divide(self) -> Iterator[Document]:
        """Yields the complete shards of the values so far, and keeps the rest."""
        ids, values, self._ids, self._values = self._ids, self._values, [], []
        for number, value in zip(ids, values, strict=True):
            if self._shards and number // OBJECTS_PER_COLUMN_SHARD != self._shards[-1]:
                yield from self._flush()
            self._ids.append(number)
            self._values.append(value)
            self._open_shard()

    def _open_shard(self) -> None:
        shard = self._ids[-1] // OBJECTS_PER_COLUMN_SHARD
        if not self._shards or self._shards[-1] != shard:
            self._shards.append(shard)

    def _flush(self) -> Iterator[Document]:
        shard = self._shards[-1]
        document = {"shard": shard, "ids": self._ids, "values": self._values}
        self._ids, self._values = [], []
        yield COLUMN_SHARDS.format(column=self._key, shard=shard), self._dump(1, document)

    def _dump(self, version: int, content: Mapping[str, Any]) -> bytes:
        return dump_document({"map3d": "column", "version": version, "name": self._name, "of": self._of, **content})


class _Summary:
    """Counts the values of a column."""

    def __init__(self) -> None:
        self._objects = 0
        self._counts: Counter[tuple[str, Attribute]] = Counter()
        self._numbers: array[float] | None = array("d")

    def count(self, value: Attribute) -> None:
        self._objects += 1
        key = (type(value).__name__, value)
        if key in self._counts or len(self._counts) < MAX_COUNTED_VALUES:
            self._counts[key] += 1
        number = _to_number(value)
        if number is None:
            self._numbers = None
        elif self._numbers is not None:
            self._numbers.append(number)

    def to_json(self) -> dict[str, Any]:
        frequent = sorted(self._counts.items(), key=lambda entry: (-entry[1], str(entry[0][1]), entry[0][0]))[:MAX_LISTED_VALUES]
        document: dict[str, Any] = {"objects": self._objects, "values": [[value, count] for (_, value), count in frequent]}
        return document if self._numbers is None else document | {"numbers": _sample(self._numbers)}


def _to_number(value: Attribute) -> float | None:
    """Returns a finite number, also from text that consists of one; None for other values."""
    if isinstance(value, bool) or (isinstance(value, str) and not _NUMBER.fullmatch(value)):
        return None
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, OverflowError):
        return None
    return number if number - number == 0 else None


def _sample(numbers: "array[float]") -> list[float]:
    """Returns evenly spaced values of the sorted numbers, with the least and the greatest."""
    ordered = sorted(numbers)
    steps = SAMPLED_NUMBERS - 1
    return [_short(ordered[k * (len(ordered) - 1) // steps]) for k in range(SAMPLED_NUMBERS)]


def _short(number: float) -> float:
    return int(number) if number == int(number) and abs(number) < 2**53 else number
