"""Finds objects that several files have, and decides which of them is drawn (docs/odd-files.md, Objects and files)."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d.coherence.surveyed_assets import Flags, Floats, SurveyedAsset
from map3d.ingest.findings import finding

LEAST_OVERLAP: Final = 0.5
"""Least share of what two boxes cover together, seen from above, that they have in common if their objects are the same."""
LEAST_M: Final = 1.0
"""Added to the sides of boxes, so that poles and walls overlap, too."""
NEAR_M: Final = 2.0
LEAST_SHARE: Final = 0.8
LEAST_OBJECTS: Final = 5
"""Least share and number of the objects of a coarser set, whatever its names, that have one of another file in their place."""


@dataclass
class Wholes:
    """The objects of all documents, in the order of the assets; each array has an entry for each."""

    assets: Sequence[SurveyedAsset]
    owners: NDArray[np.int64] = field(init=False)
    kinds: NDArray[np.int64] = field(init=False)
    boxes: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.owners = np.repeat(np.arange(len(self.assets)), [len(asset.firsts) for asset in self.assets])
        self.kinds = np.unique(self._all("classes"), return_inverse=True)[1]
        self.boxes = np.concatenate([asset.boxes for asset in self.assets])
        self.names, self.contents, self.drawn = self._all("names"), self._all("contents"), self._all("drawn")
        # Which of several is drawn: the finest, then one with textures, then one with more triangles, then that of the first file.
        keys = (self.owners, -self._all("triangles").astype(np.int64), ~self._all("textured"), -self._all("lods"))
        self.ranks = np.empty(len(self.owners), dtype=np.int64)
        self.ranks[np.lexsort(keys)] = np.arange(len(self.owners))
        self.lods = self._all("lods")
        self.firsts = np.cumsum([0, *(len(asset.firsts) for asset in self.assets)])

    def _all(self, name: str) -> NDArray[Any]:
        return np.concatenate([getattr(asset, name) for asset in self.assets])


@dataclass(frozen=True)
class SameObjects:
    """`kept`: asset → (wholes,) whether a whole is drawn; `findings`: asset → what is said of the others."""

    kept: Mapping[str, Flags]
    findings: Mapping[str, list[dict[str, Any]]]


def find_same_objects(assets: Sequence[SurveyedAsset]) -> SameObjects:
    """Compares all documents. Objects of one file are not compared with each other."""
    documents = [asset for asset in assets if not asset.is_raster and len(asset.firsts)]
    kept = {asset.name: np.ones(len(asset.firsts), dtype=bool) for asset in assets}
    if len(documents) < 2:
        return SameObjects(kept, {})
    wholes = Wholes(documents)
    chosen = np.full(len(wholes.owners), -1, dtype=np.int64)
    for axis in (0, 1):
        _choose(wholes, chosen, wholes.names, axis)
    _choose(wholes, chosen, wholes.contents, 0)
    _choose_finer_sets(wholes, chosen)
    found: dict[str, list[dict[str, Any]]] = {}
    for number, asset in enumerate(documents):
        own = chosen[wholes.firsts[number] : wholes.firsts[number + 1]]
        kept[asset.name] = own < 0
        if (own >= 0).any():
            found[asset.name] = _findings(wholes, number, own)
    return SameObjects(kept, found)


def _choose(wholes: Wholes, chosen: NDArray[np.int64], keys: NDArray[np.uint64], axis: int) -> None:
    """Chooses one of the objects of one class that have the same key and lie in the same place. `chosen`: the whole that is drawn in place of each,
    -1 for those that are drawn themselves."""
    candidates = np.flatnonzero((keys != 0) & wholes.drawn & (chosen < 0))
    middle = wholes.boxes[candidates, :, axis].sum(axis=1)
    candidates = candidates[np.lexsort((middle, wholes.kinds[candidates], keys[candidates]))]
    if len(candidates) < 2:
        return
    before, after = candidates[:-1], candidates[1:]
    is_same = (keys[before] == keys[after]) & (wholes.kinds[before] == wholes.kinds[after])
    is_same[is_same] = _overlap(wholes.boxes[before[is_same]], wholes.boxes[after[is_same]])
    group = np.concatenate([[0], np.cumsum(~is_same)])
    best = np.full(group[-1] + 1, len(wholes.owners), dtype=np.int64)
    np.minimum.at(best, group, wholes.ranks[candidates])
    by_rank = np.empty(len(wholes.owners), dtype=np.int64)
    by_rank[wholes.ranks] = np.arange(len(wholes.owners))
    leaders = by_rank[best][group]
    left = wholes.owners[candidates] != wholes.owners[leaders]
    chosen[candidates[left]] = leaders[left]


def _overlap(one: Floats, other: Floats) -> Flags:
    """Returns (n,) whether boxes share enough of what both cover, seen from above."""
    low, high = np.minimum(one[:, 0, :2], other[:, 0, :2]), np.maximum(one[:, 1, :2], other[:, 1, :2])
    shared = np.minimum(one[:, 1, :2], other[:, 1, :2]) - np.maximum(one[:, 0, :2], other[:, 0, :2])
    both = np.maximum(shared + LEAST_M, 0.0).prod(axis=1)
    found: Flags = both >= LEAST_OVERLAP * (high - low + LEAST_M).prod(axis=1)
    return found


def _choose_finer_sets(wholes: Wholes, chosen: NDArray[np.int64]) -> None:
    """Leaves out the objects of a coarser set of the same objects under other names: of files in which nearly every object has a finer one of another
    file in its place."""
    rows = np.flatnonzero(wholes.drawn & (chosen < 0) & (wholes.lods >= 0))
    if len(np.unique(wholes.lods[rows])) < 2:
        return
    finer = _finer_in_place(wholes, rows)
    counts, matched = Counter(wholes.owners[rows].tolist()), Counter(wholes.owners[rows[finer >= 0]].tolist())
    sets = [owner for owner, count in matched.items() if count >= LEAST_OBJECTS and count >= LEAST_SHARE * counts[owner]]
    left = (finer >= 0) & np.isin(wholes.owners[rows], sets)
    chosen[rows[left]] = finer[left]


def _finer_in_place(wholes: Wholes, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns (rows,) for each whole one of another file that is finer and in its place, -1 without any."""
    centres = wholes.boxes[rows, :, :2].mean(axis=1)
    cells = np.floor(centres / NEAR_M).astype(np.int64)
    found = np.full(len(rows), -1, dtype=np.int64)
    keys = _cell_keys(cells)
    order = np.argsort(keys, kind="stable")
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            wanted = _cell_keys(cells + np.array([dx, dy]))
            first = np.searchsorted(keys[order], wanted)
            for step in range(4):
                place = np.minimum(first + step, len(rows) - 1)
                other = rows[order[place]]
                hits = (keys[order[place]] == wanted) & (wholes.kinds[other] == wholes.kinds[rows]) & (wholes.owners[other] != wholes.owners[rows])
                hits &= (wholes.lods[other] > wholes.lods[rows]) & (found < 0)
                hits[hits] = _overlap(wholes.boxes[rows[hits]], wholes.boxes[other[hits]])
                found[hits] = other[hits]
    return found


def _cell_keys(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    keys: NDArray[np.int64] = cells[:, 0] * (1 << 32) + cells[:, 1]
    return keys


def _findings(wholes: Wholes, number: int, own: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Says, for each other file, how many objects it has in place of those of one file. `own`: (wholes,) as `chosen`."""
    asset, left = wholes.assets[number], np.flatnonzero(own >= 0)
    owners = wholes.owners[own[left]]
    found = []
    for owner in np.unique(owners).tolist():
        there = left[owners == owner]
        other = wholes.assets[owner]
        file = asset.label_of(other)
        is_equal = asset.contents[there] == wholes.contents[own[there]]
        if len(there) == len(own) and is_equal.all():
            found.append(finding("file-is-copy", len(there), "", file=file))
            continue
        is_finer = wholes.lods[own[there]] > asset.lods[there]
        for code, chosen in (("objects-finer-elsewhere", is_finer), ("objects-elsewhere", ~is_finer)):
            if chosen.any():
                found.append(finding(code, int(chosen.sum()), ", ".join(asset.names_of(there[chosen], 3)), file=file))
    return found
