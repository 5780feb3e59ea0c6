"""The list of attribute columns (spec/manifest.md)."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any, Final

from map3d.registry.registered_objects import Attribute, RegisteredObject

MAX_COLUMNS: Final = 1000
"""The attributes with the most values have columns. Otherwise a source with different attribute names per object would have a file per object."""

MAX_VARIETY: Final = 1000
"""Distinct values are counted up to this number."""

OF_OBJECT: Final = "object"
OF_ATTRIBUTES: Final = "attributes"
_FIELDS: Final[Mapping[str, Callable[[RegisteredObject], str]]] = {"class": lambda item: item.kind, "asset": lambda item: item.asset}
"""Fields that every object has besides its attributes."""

ColumnId = tuple[str, str]
"""OF_OBJECT or OF_ATTRIBUTES, and the name of the field or attribute."""


def column_key(of: str, name: str) -> str:
    """Returns the name of a column's file, which depends only on the attribute."""
    return sha256(f"{of}\0{name}".encode("utf-8", "surrogatepass")).hexdigest()[:16]


def attribute_index(objects: Iterable[RegisteredObject]) -> dict[str, Any]:
    """Returns the document that lists the columns: fields first, then attributes by name."""
    found: dict[ColumnId, _ColumnStatistics] = {}
    for item in objects:
        for column_id, value in object_values(item):
            found.setdefault(column_id, _ColumnStatistics()).count(value)
    fields = [column_id for column_id in found if column_id[0] == OF_OBJECT]
    attributes = sorted(
        (column_id for column_id in found if column_id[0] == OF_ATTRIBUTES), key=lambda column_id: (-found[column_id].objects, column_id[1])
    )
    rows = [found[column_id].to_json(column_id) for column_id in [*fields, *sorted(attributes[:MAX_COLUMNS])]]
    return {"map3d": "attributes", "version": 1, "attributes": rows, "left_out": max(len(attributes) - MAX_COLUMNS, 0)}


@dataclass
class _ColumnStatistics:
    """Statistics of an attribute's values."""

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
        if len(self.different) < MAX_VARIETY:
            self.different.add((kind, value))

    def to_json(self, column_id: ColumnId) -> dict[str, Any]:
        of, name = column_id
        kind = "mixed" if len(self.kinds) > 1 else min(self.kinds)
        row = {"name": name, "of": of, "column": column_key(of, name), "type": kind, "objects": self.objects, "variety": len(self.different)}
        return row | ({"min": self.low, "max": self.high} if kind == "number" else {})


def object_values(item: RegisteredObject) -> Iterator[tuple[ColumnId, Attribute]]:
    """Yields the object's own values by column."""
    yield from (((OF_OBJECT, name), read(item)) for name, read in _FIELDS.items())
    yield from (((OF_ATTRIBUTES, name), value) for name, value in item.attributes.items() if value is not None)
