"""Objects before and after registration."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from map3d.types import Box

Attribute = str | float | int | bool | None


@dataclass(frozen=True)
class NewObject:
    """A line of objects.jsonl with its box. `parent`: index among the objects of the same import, None at the top. `box`: local, None without own
    geometry."""

    name: str
    kind: str
    parent: int | None = None
    lod: str | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    box: Box | None = None


@dataclass(frozen=True)
class RegisteredObject:
    """`kind`: the object's class; `parent`: the parent's id; `box`: local, including all descendants, None without any geometry."""

    id: int
    asset: str
    name: str
    kind: str
    parent: int | None
    lod: str | None
    attributes: Mapping[str, Attribute]
    box: Box | None

    @property
    def label(self) -> str:
        """Name and address for the search index, common name first: `St. Martin (DEBY_LOD2_1), Marktplatz 1`."""
        common_name, address = (_text(self.attributes.get(key)) for key in ("name", "address"))
        name = f"{common_name} ({self.name})" if common_name and common_name != self.name else self.name
        return f"{name}, {address}" if address else name

    def to_json(self) -> dict[str, Any]:
        """Returns the object's entry in an attribute shard."""
        return {
            "name": self.name,
            "class": self.kind,
            "parent": self.parent,
            "asset": self.asset,
            "box": None if self.box is None else [list(corner) for corner in self.box],
            "attributes": dict(self.attributes),
        }


@dataclass(frozen=True)
class AssetSummary:
    """`box`: local, None without any geometry; `lods`: the levels of detail that occur, ordered."""

    count: int
    box: Box | None
    lods: tuple[str, ...]


def plain_attributes(attributes: Mapping[str, Any]) -> dict[str, Attribute]:
    """Converts attributes to strings, numbers, booleans or null. Other values become JSON text; NaN and infinities become null."""
    return {str(key): _plain(value) for key, value in attributes.items()}


def _text(value: Attribute) -> str:
    return value.strip() if isinstance(value, str) else ""


def _plain(value: Any) -> Attribute:
    if value is None or isinstance(value, bool | str | int):
        return value
    if isinstance(value, float):
        return value if value - value == 0 else None
    return json.dumps(value, ensure_ascii=False, sort_keys=True)


@dataclass(frozen=True)
class ObjectKind:
    """Objects of one class and level of detail. `drawn`: those that have geometry, of their own or of their parts."""

    kind: str
    lod: str | None
    count: int
    drawn: int
