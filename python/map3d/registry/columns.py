"""Attributes column by column (spec/manifest.md): what one attribute says of all objects, for colouring and filtering them."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any, Final

from map3d.registry.objects import Attribute, RegisteredObject

MOST_COLUMNS: Final = 1000
"""Those of most objects; a source with a name of its own for every object would else have as many files as objects."""

MOST_VARIETY: Final = 1000
"""Different values are counted up to here."""

VALUES_AT_ONCE: Final = 2_000_000
"""As many values are held in memory while columns are written."""

OF_OBJECT: Final = "object"
OF_ATTRIBUTES: Final = "attributes"
_FIELDS: Final[Mapping[str, Callable[[RegisteredObject], str]]] = {"class": lambda item: item.kind, "asset": lambda item: item.asset}
"""What every object has besides its attributes."""

Objects = Callable[[], Iterable[RegisteredObject]]
Source = tuple[str, str]
"""OF_OBJECT or OF_ATTRIBUTES, and a name."""


def column_key(of: str, name: str) -> str:
    """Names a column's file; the same wherever the attribute is."""
    return sha256(f"{of}\0{name}".encode("utf-8", "surrogatepass")).hexdigest()[:16]


def attribute_index(objects: Iterable[RegisteredObject]) -> dict[str, Any]:
    """The document that lists the columns: fields first, then attributes by name."""
    found: dict[Source, _Survey] = {}
    for item in objects:
        for source, value in _values(item):
            found.setdefault(source, _Survey()).count(value)
    fields = [source for source in found if source[0] == OF_OBJECT]
    attributes = sorted((source for source in found if source[0] == OF_ATTRIBUTES), key=lambda source: (-found[source].objects, source[1]))
    rows = [found[source].to_json(source) for source in [*fields, *sorted(attributes[:MOST_COLUMNS])]]
    return {"map3d": "attributes", "version": 1, "attributes": rows, "left_out": max(len(attributes) - MOST_COLUMNS, 0)}


def column(objects: Objects, key: str) -> dict[str, Any] | None:
    """A column's document; None when no attribute has this key."""
    sources = {source for item in objects() for source, _ in _values(item) if column_key(*source) == key}
    return next((document for _, document in _columns(objects, sources)), None)


def columns(objects: Objects) -> Iterator[tuple[str, dict[str, Any]]]:
    """Keys and documents of all columns that are listed."""
    batch: list[Source] = []
    held = 0
    for row in attribute_index(objects())["attributes"]:
        if batch and held + row["objects"] > VALUES_AT_ONCE:
            yield from _columns(objects, batch)
            batch, held = [], 0
        batch.append((row["of"], row["name"]))
        held += row["objects"]
    yield from _columns(objects, batch)


@dataclass
class _Survey:
    """What is known of an attribute's values."""

    objects: int = 0
    kinds: set[str] = field(default_factory=set)
    low: float | None = None
    high: float | None = None
    different: set[tuple[str, Any]] = field(default_factory=set)

    def count(self, value: Attribute) -> None:
        kind = "boolean" if isinstance(value, bool) else "text" if isinstance(value, str) else "number"
        self.objects += 1
        self.kinds.add(kind)
        if isinstance(value, int | float) and kind == "number":
            self.low = value if self.low is None else min(self.low, value)
            self.high = value if self.high is None else max(self.high, value)
        if len(self.different) < MOST_VARIETY:
            self.different.add((kind, value))

    def to_json(self, source: Source) -> dict[str, Any]:
        of, name = source
        kind = "mixed" if len(self.kinds) > 1 else min(self.kinds)
        row = {"name": name, "of": of, "column": column_key(of, name), "type": kind, "objects": self.objects, "variety": len(self.different)}
        return row | ({"min": self.low, "max": self.high} if kind == "number" else {})


def _values(item: RegisteredObject) -> Iterator[tuple[Source, Attribute]]:
    yield from (((OF_OBJECT, name), read(item)) for name, read in _FIELDS.items())
    yield from (((OF_ATTRIBUTES, name), value) for name, value in item.attributes.items() if value is not None)


def _columns(objects: Objects, sources: Collection[Source]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Objects without a value have that of the nearest one they are part of."""
    own: dict[Source, dict[int, Attribute]] = {source: {} for source in sources}
    parents: dict[int, int] = {}
    for item in objects() if own else ():
        if item.parent is not None:
            parents[item.id] = item.parent
        for source, value in _values(item):
            if source in own:
                own[source][item.id] = value
    for (of, name), values in own.items():
        every = values | {
            number: values[above] for number in parents if number not in values and (above := _nearest(number, parents, values)) in values
        }
        ids = sorted(every)
        yield column_key(of, name), {"map3d": "column", "version": 1, "name": name, "of": of, "ids": ids, "values": [every[number] for number in ids]}


def _nearest(number: int, parents: Mapping[int, int], values: Mapping[int, Attribute]) -> int:
    """The nearest object above that has a value; without one any without."""
    seen = {number}
    while number not in values and parents.get(number, number) not in seen:
        number = parents[number]
        seen.add(number)
    return number
