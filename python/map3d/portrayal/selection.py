"""Which objects of a scene a view shows: layers, levels of detail, and objects within a bounding box."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from map3d.registry import Registry
from map3d.types import Box

SPATIAL: Final = ("overlaps", "contains_center")


@dataclass(frozen=True)
class Selection:
    """`assets`: None for all, also the ground plane; `lods`: requested level by asset; `lod_selection`: how it is compared.

    `box`: local; `spatial`: overlaps or contains_center chooses whole features by their boxes, cut leaves out everything outside.
    """

    assets: tuple[str, ...] | None = None
    lods: tuple[tuple[str, str], ...] = ()
    lod_selection: str = "equals"
    box: Box | None = None
    spatial: str = "overlaps"

    @property
    def is_everything(self) -> bool:
        return self.assets is None and not self.chooses_levels and self.box is None

    @property
    def chooses_levels(self) -> bool:
        return bool(self.lods) and self.lod_selection != "equals_or_similar"

    @property
    def needs_objects(self) -> bool:
        """Whether the registry has to be asked."""
        return self.assets is not None or self.chooses_levels or (self.box is not None and self.spatial in SPATIAL)

    @property
    def cut(self) -> Box | None:
        """The box outside which nothing is visible."""
        return self.box if self.spatial == "cut" else None

    def to_json(self) -> dict[str, Any]:
        return {
            "assets": None if self.assets is None else list(self.assets),
            "lods": [list(pair) for pair in self.lods],
            "lod_selection": self.lod_selection,
            "box": None if self.box is None else [list(corner) for corner in self.box],
            "spatial": self.spatial,
        }

    @classmethod
    def load(cls, value: Mapping[str, Any]) -> Self:
        assets, box = value["assets"], value["box"]
        return cls(
            None if assets is None else tuple(assets),
            tuple((asset, lod) for asset, lod in value["lods"]),
            value["lod_selection"],
            None if box is None else (tuple(box[0]), tuple(box[1])),
            value["spatial"],
        )


def select_objects(path: Path, selection: Selection) -> NDArray[np.uint32]:
    """Returns the ids of the chosen objects, ascending. `path`: the scene's registry."""
    lods = dict(selection.lods) if selection.chooses_levels else {}
    chosen: list[int] = []
    with Registry(path) as registry:
        assets = registry.asset_summaries() if selection.assets is None else selection.assets
        for asset in assets:
            rows = list(registry.rows_of([asset]))
            inside = None if selection.box is None or selection.spatial not in SPATIAL else _features_in_box(rows, selection.box, selection.spatial)
            for number, _, lod, _ in rows:
                if (inside is None or number in inside) and _has_level(lod, lods.get(asset), selection.lod_selection):
                    chosen.append(number)
    return np.array(sorted(chosen), np.uint32)


_Row = tuple[int, int | None, str | None, Box | None]


def _has_level(lod: str | None, wanted: str | None, method: str) -> bool:
    """Whether an object at level `lod` is part of a view at level `wanted`. Each object has one level in a scene."""
    if wanted is None:
        return True
    if lod is None:
        return False
    return lod == wanted if method == "equals" else _order(lod) <= _order(wanted)


def _order(lod: str) -> tuple[int, ...]:
    return tuple(int(part) if part.isdigit() else -1 for part in lod.split("."))


def _features_in_box(rows: Sequence[_Row], box: Box, spatial: str) -> set[int]:
    """Returns the ids of the features in a box with all their parts: a feature is an object without parent."""
    parents = {number: parent for number, parent, _, _ in rows}
    tops = {number for number, parent, _, found in rows if parent not in parents and found is not None and _is_in(found, box, spatial)}
    return {number for number in parents if any(above in tops for above in _with_ancestors(number, parents))}


def _with_ancestors(number: int, parents: Mapping[int, int | None]) -> Iterator[int]:
    seen = set()
    above: int | None = number
    while above is not None and above in parents and above not in seen:
        seen.add(above)
        yield above
        above = parents[above]


def _is_in(found: Box, box: Box, spatial: str) -> bool:
    if spatial == "contains_center":
        return all(low <= (a + b) / 2 <= high for a, b, low, high in zip(*found, *box, strict=True))
    return all(a <= high and b >= low for a, b, low, high in zip(*found, *box, strict=True))
