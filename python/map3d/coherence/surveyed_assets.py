"""The objects of a scene as imported, with their parts as one: what the check compares."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.catalogue import AssetRecord
from map3d.ingest.terrain.terrain_import import CLASS as RASTER_CLASS

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

TERRAIN_CLASSES: Final = (RASTER_CLASS, "relief_feature", "tinrelief", "raster_relief")
_TEXTURED: Final = 1
_INSTANCES: Final = 2
_ID_BYTES: Final = 4


@dataclass
class SurveyedAsset:
    """An asset with its survey. A *whole* is an object without parent, with all objects below it; arrays of wholes have an entry for each."""

    record: AssetRecord
    folder: Path

    @cached_property
    def survey(self) -> _core.Survey:
        return _core.Survey(str(self.folder))

    @property
    def name(self) -> str:
        return self.record.name

    @property
    def source(self) -> str:
        return Path(self.record.source).name

    @property
    def is_raster(self) -> bool:
        return "rasters" in self.record.report

    @property
    def has_heights(self) -> bool:
        """Whether a raster has an elevation model, not a photo alone."""
        return bool(self.record.report.get("rasters", {}).get("elevation"))

    @cached_property
    def count(self) -> int:
        return (self.folder / "ids.u32").stat().st_size // _ID_BYTES

    @cached_property
    def roots(self) -> NDArray[np.int64]:
        """(objects,) the number of the whole that each object belongs to."""
        if self.is_raster:
            return self.firsts
        tops, number = self._tops, np.cumsum(self._is_top) - 1
        found: NDArray[np.int64] = number[tops]
        return found

    @cached_property
    def firsts(self) -> NDArray[np.int64]:
        """(wholes,) the object at the top of each; rasters have no parts, and need no survey for that."""
        return np.arange(self.count) if self.is_raster else np.flatnonzero(self._is_top)

    @cached_property
    def classes(self) -> NDArray[np.str_]:
        """(wholes,)"""
        names = np.array(self.survey.classes or [""], dtype=np.str_)
        found: NDArray[np.str_] = names[self.survey.class_numbers[self.firsts]]
        return found

    @cached_property
    def names(self) -> NDArray[np.uint64]:
        """(wholes,) hashes of names, 0 without one."""
        found: NDArray[np.uint64] = self.survey.names[self.firsts]
        return found

    @cached_property
    def boxes(self) -> Floats:
        """(wholes, 2, 3); infinite, low above high, without geometry."""
        boxes, order, starts = self.survey.boxes, self._order, self._starts
        if not len(starts):
            return np.empty((0, 2, 3))
        low, high = np.minimum.reduceat(boxes[order, 0], starts), np.maximum.reduceat(boxes[order, 1], starts)
        return np.stack([low, high], axis=1)

    @cached_property
    def drawn(self) -> Flags:
        """(wholes,) whether there is geometry."""
        low, high = self.boxes[:, 0], self.boxes[:, 1]
        return np.asarray((low <= high).all(axis=1), dtype=bool)

    @cached_property
    def contents(self) -> NDArray[np.uint64]:
        """(wholes,) hashes of the geometry."""
        return self._sum(self.survey.contents)

    @cached_property
    def triangles(self) -> NDArray[np.uint64]:
        return self._sum(self.survey.triangles.astype(np.uint64))

    @cached_property
    def textured(self) -> Flags:
        return self._sum((self.survey.flags & _TEXTURED).astype(np.uint64)) > 0

    @cached_property
    def placed(self) -> Flags:
        """(wholes,) whether there are placed prototypes."""
        return self._sum(((self.survey.flags & _INSTANCES) > 0).astype(np.uint64)) > 0

    @cached_property
    def lods(self) -> Floats:
        """(wholes,) the finest level of detail, -1 without one."""
        numbers = np.array([lod_number(text) for text in self.survey.lods])[self.survey.lod_numbers]
        return np.maximum.reduceat(numbers[self._order], self._starts) if len(self._starts) else np.empty(0)

    @cached_property
    def is_terrain(self) -> Flags:
        """(wholes,) whether a whole is the ground: relief, or a raster."""
        found: Flags = np.isin(self.classes, TERRAIN_CLASSES)
        return found

    def spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Returns values of wholes for each object."""
        return values[self.roots]

    def label_of(self, other: "SurveyedAsset") -> str:
        """Returns the name of another asset's file, with as many of its folders as tell it from this one's."""
        one, two = Path(self.record.source).parts, Path(other.record.source).parts
        depth = 1
        while one[-depth:] == two[-depth:] and depth < min(len(one), len(two)):
            depth += 1
        return "/".join(two[-depth:])

    def names_of(self, wholes: NDArray[np.int64], limit: int) -> list[str]:
        """Returns the names of the first of some wholes."""
        wanted = [int(self.firsts[number]) for number in wholes[:limit]]
        lines = dict(self._lines(set(wanted)))
        return [lines[number] or f"object {number + 1}" for number in wanted]

    def _lines(self, wanted: set[int]) -> Iterator[tuple[int, str]]:
        with (self.folder / "objects.jsonl").open(encoding="utf-8") as lines:
            for number, line in enumerate(islice(lines, max(wanted, default=-1) + 1)):
                if number in wanted:
                    yield number, _name(line)

    def _sum(self, values: NDArray[np.uint64]) -> NDArray[np.uint64]:
        return np.add.reduceat(values[self._order], self._starts) if len(self._starts) else np.empty(0, dtype=np.uint64)

    @cached_property
    def _is_top(self) -> Flags:
        return np.asarray(self._tops == np.arange(self.count), dtype=bool)

    @cached_property
    def _tops(self) -> NDArray[np.int64]:
        """(objects,) the object at the top of each; of a cycle of parents, any of its members."""
        parents = self.survey.parents
        tops = np.where(parents < 0, np.arange(self.count), np.clip(parents, 0, max(self.count - 1, 0)))
        for _ in range(64):
            above = tops[tops]
            if np.array_equal(above, tops):
                return tops
            tops = above
        return np.where(tops[tops] == tops, tops, np.arange(self.count))

    @cached_property
    def _order(self) -> NDArray[np.int64]:
        return np.argsort(self.roots, kind="stable")

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        return np.searchsorted(self.roots[self._order], np.arange(len(self.firsts)))


def lod_number(text: str) -> float:
    """Returns the number of a level of detail such as "2" or "2.1", -1 without one."""
    found = re.match(r"[0-9]+(\.[0-9]+)?", text)
    return float(found[0]) if found else -1.0


def _name(line: str) -> str:
    return str(json.loads(line)["name"])
