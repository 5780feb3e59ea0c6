"""Attribute shards and the search index of a rendering's objects (spec/manifest.md), as documents; equal objects give equal bytes."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from map3d.tiles.manifest import SHARD_SIZE
from map3d.types import Box

VERSION: Final = 1
AttributeValue = str | float | int | bool | None


@dataclass(frozen=True)
class ObjectFacts:
    """An object as clients see it. `box`: local; None when the object has no content. `address`: for the search label, may be empty."""

    id: int
    name: str
    kind: str
    parent: int | None
    asset: str
    box: Box | None
    attributes: Mapping[str, AttributeValue] = field(default_factory=dict)
    address: str = ""

    @property
    def label(self) -> str:
        return f"{self.name}, {self.address}" if self.address and self.address != self.name else self.name


def shard_of(object_id: int) -> int:
    return object_id // SHARD_SIZE


def shard_bytes(shard: int, objects: Iterable[ObjectFacts]) -> bytes:
    """The shard's document, of those of `objects` that belong to it."""
    rows = {str(one.id): _row(one) for one in sorted(objects, key=lambda one: one.id) if shard_of(one.id) == shard}
    return _dump({"map3d": "objects", "version": VERSION, "shard": shard, "objects": rows})


def search_bytes(objects: Iterable[ObjectFacts]) -> bytes:
    """The search index: [id, label, top centre] by label, then id; objects without content or name are not found."""
    found = [(one.label, one.id, _top_centre(one.box)) for one in objects if one.box is not None and one.label]
    return _dump({"map3d": "search", "version": VERSION, "entries": [[number, label, place] for label, number, place in sorted(found)]})


def _row(one: ObjectFacts) -> dict[str, Any]:
    return {
        "name": one.name,
        "class": one.kind,
        "parent": one.parent,
        "asset": one.asset,
        "box": None if one.box is None else [[_mm(value) for value in corner] for corner in one.box],
        "attributes": dict(sorted(one.attributes.items())),
    }


def _top_centre(box: Box) -> list[float]:
    lo, hi = box
    return [_mm((lo[0] + hi[0]) / 2), _mm((lo[1] + hi[1]) / 2), _mm(hi[2])]


def _mm(value: float) -> float:
    """Millimetres are enough for a client, and short."""
    return round(value, 3)


def _dump(value: Mapping[str, Any]) -> bytes:
    return (json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False) + "\n").encode()
