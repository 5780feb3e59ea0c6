"""Objects before and after registration."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from map3d.registry.kinds import decoded_kind
from map3d.types import Box

_IDENTIFIER: Final = re.compile(r"\S*([0-9]{3}|_)\S*\Z")
"""One word with three digits in a row, or with an underscore."""

Attribute = str | float | int | bool | None


@dataclass(frozen=True)
class NewObject:
    """A line of objects.jsonl with its box. `parent`: index among the objects of the same import, None at the top. `box`: local, None if it has
    no geometry of its own."""

    name: str
    kind: str
    parent: int | None = None
    lod: str | None = None
    attributes: Mapping[str, Any] = field(default_factory=dict)
    box: Box | None = None


@dataclass(frozen=True)
class RegisteredObject:
    """`kind`: the object's class; `parent`: the parent's id; `box`: local, including all descendants, None if they have no geometry."""

    id: int
    asset: str
    name: str
    kind: str
    parent: int | None
    lod: str | None
    attributes: Mapping[str, Attribute]
    box: Box | None

    @property
    def proper_name(self) -> str:
        """The name that people use; empty if there is only an identifier of the data, such as a gml:id."""
        names = (_text(self.attributes.get("name")), self.name.strip())
        return next((name for name in names if name and not _IDENTIFIER.match(name)), "")

    @property
    def label(self) -> str:
        """Name and address; without both, the decoded function; empty if the data has nothing that people would say."""
        named = ", ".join(filter(None, (self.proper_name, _text(self.attributes.get("address")))))
        return named or decoded_kind(self.attributes)

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
class RegisteredAsset:
    """`box`: local, None if the asset has no geometry; `lods`: the levels of detail that occur, ordered."""

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
