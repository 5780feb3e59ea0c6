"""Compares the bases of objects with those of the files beside them, which lie between theirs or along a common border (docs/odd-files.md, Height).

Bases are compared in cells: the median of one file with those of other files in the same cell and the eight around it. Files whose bases agree are a
*level*; of the levels that touch each other, the one with the most objects is right, unless what explains the distance says otherwise.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d.coherence.height_kinds import DEVIATIONS, GROUND_KINDS, TOLERANCE_M, GeoidHeight, are_zero, find_kind, robust_middle
from map3d.coherence.surveyed_assets import Floats

CELL_M: Final = 50.0
STEEPEST: Final = 0.5
"""Rise of the ground, in metres per metre, that explains the distance between the bases of two cells."""
LEAST_OBJECTS: Final = 3
LONE_M: Final = 100.0
"""Least number of objects of each of two files in cells that are compared. Fewer ones, as of models that are one object, contradict others by this
distance."""
SAME_LEVEL: Final = 0.1
"""Part of the distance between two files by which others may differ that are as far from them."""

Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class FileBases:
    """What stands in one file. `bases`: (n, 3) world coordinates; `sizes`: (n,) metres across; `is_right`: whether they fit the terrain;
    `is_guessed`: as in `find_kind`."""

    bases: Floats
    sizes: Floats
    is_right: bool
    is_guessed: bool


@dataclass(frozen=True)
class FileDifference:
    """A file that contradicts the file beside it, both as numbers. `kind`: as in `find_kind`; `metres`: from the bases beside it to its own."""

    file: int
    beside: int
    kind: str
    metres: float


@dataclass(frozen=True)
class _Pair:
    """Heights of two files in cells that touch: (n,) each; `apart_m` from the middle of one to that of the other, with half the sizes of objects;
    `least_m`: distance that contradicts anyway."""

    one: Floats
    other: Floats
    apart_m: Floats
    least_m: float

    @cached_property
    def metres(self) -> float:
        """From the bases of the other file to those of the one."""
        return robust_middle(self.one - self.other)[0]

    @cached_property
    def contradicts(self) -> bool:
        """Whether the distance is more than a slope explains."""
        metres, deviation = robust_middle(self.one - self.other)
        return abs(metres) > max(self.least_m + STEEPEST * float(np.median(self.apart_m)), DEVIATIONS * deviation)

    @property
    def turned(self) -> "_Pair":
        return _Pair(self.other, self.one, self.apart_m, self.least_m)


_Touched = Mapping[int, Mapping[int, _Pair]]
"""File → each other file that it touches → their heights, those of the first file as `one`."""


def compare_files(files: Sequence[FileBases], geoid: GeoidHeight) -> list[FileDifference]:
    """Returns the files that contradict those beside them, in their order."""
    pairs = dict(_pairs(files))
    if not any(pair.contradicts for pair in pairs.values()):
        return []
    levels = _levels(len(files), pairs)
    touched = _both_ways(pairs)
    found: list[FileDifference] = []
    for group in _touching(levels, pairs):
        found += _of_group(files, touched, group, geoid)
    return sorted(found, key=lambda difference: difference.file)


def _of_group(files: Sequence[FileBases], touched: _Touched, offsets: Mapping[int, float], geoid: GeoidHeight) -> Iterator[FileDifference]:
    """Judges files that touch each other. `offsets`: file → metres from the first of them."""
    right_m = _right_level(files, offsets)
    right = {number for number, metres in offsets.items() if _is_same(metres, right_m)}
    wrong = offsets.keys() - right
    kinds = {number: _kind(files, touched[number], number, right, geoid) for number in wrong}
    known = {kind for kind in kinds.values() if kind is not None}
    if known and known <= set(GROUND_KINDS) and not any(files[number].is_right for number in right):
        wrong, right = right, wrong
        kinds = {number: _kind(files, touched[number], number, right, geoid) for number in wrong}
        right_m = float(np.median([offsets[number] for number in right]))
    for number in sorted(wrong):
        metres = offsets[number] - right_m
        alike = (kind for other, kind in kinds.items() if kind is not None and _is_same(offsets[other] - right_m, metres))
        kind = kinds[number] or next(alike, None) or _kind_of_distance(files[number].bases[:, 2], metres)
        yield FileDifference(number, _beside(touched[number], right), kind, metres)


def _kind_of_distance(base: Floats, metres: float) -> str:
    """Returns the kind of a file that touches no right one."""
    if are_zero(base):
        return "heights-at-zero"
    return "heights-below-terrain" if metres < 0 else "heights-above-terrain"


def _right_level(files: Sequence[FileBases], offsets: Mapping[int, float]) -> float:
    """Returns the offset of the files that fit the terrain, else of those whose unit is known, else of those with the most objects."""
    levels: dict[float, list[int]] = {}
    for number, metres in offsets.items():
        levels.setdefault(metres, []).append(number)

    def trust(metres: float) -> tuple[bool, bool, int, int]:
        same = [files[number] for other, numbers in levels.items() if _is_same(other, metres) for number in numbers]
        size = sum(len(file.bases) for file in same)
        return any(file.is_right for file in same), not all(file.is_guessed for file in same), size, -min(levels[metres])

    return max(levels, key=trust)


def _is_same(one_m: float, other_m: float) -> bool:
    return abs(one_m - other_m) <= max(TOLERANCE_M, SAME_LEVEL * max(abs(one_m), abs(other_m)))


def _kind(files: Sequence[FileBases], touched: Mapping[int, _Pair], number: int, right: Set[int], geoid: GeoidHeight) -> str | None:
    """Returns what explains the distance of a file from the right ones that it touches; None if it touches none."""
    pairs = [pair for other, pair in sorted(touched.items()) if other in right]
    if not pairs:
        return None
    base, ground = (np.concatenate(values) for values in zip(*((pair.one, pair.other) for pair in pairs), strict=True))
    if are_zero(ground) and not are_zero(base):
        return GROUND_KINDS[0]
    return find_kind(base, ground, is_guessed=files[number].is_guessed, geoid=geoid)


def _beside(touched: Mapping[int, _Pair], right: Set[int]) -> int:
    """Returns the right file that a file touches in most cells, the first one if it touches none."""
    cells = {other: len(pair.one) for other, pair in touched.items() if other in right}
    return max(cells, key=lambda other: (cells[other], -other), default=min(right))


def _both_ways(pairs: Mapping[tuple[int, int], _Pair]) -> _Touched:
    found: dict[int, dict[int, _Pair]] = {}
    for (one, other), pair in pairs.items():
        found.setdefault(one, {})[other] = pair
        found.setdefault(other, {})[one] = pair.turned
    return found


def _levels(count: int, pairs: Mapping[tuple[int, int], _Pair]) -> list[int]:
    """Returns for each file the first one of its level."""
    parents = list(range(count))

    def first(number: int) -> int:
        while parents[number] != number:
            parents[number] = parents[parents[number]]
            number = parents[number]
        return number

    for (one, other), pair in pairs.items():
        if not pair.contradicts:
            kept, gone = sorted((first(one), first(other)))
            parents[gone] = kept
    return [first(number) for number in range(count)]


def _touching(levels: Sequence[int], pairs: Mapping[tuple[int, int], _Pair]) -> Iterator[dict[int, float]]:
    """Yields groups of several levels that touch: file → metres from the first level of the group."""
    steps: dict[int, dict[int, list[float]]] = {}
    for (one, other), pair in pairs.items():
        if levels[one] != levels[other]:
            steps.setdefault(levels[other], {}).setdefault(levels[one], []).append(pair.metres)
            steps.setdefault(levels[one], {}).setdefault(levels[other], []).append(-pair.metres)
    placed: set[int] = set()
    for start in sorted(steps):
        if start in placed:
            continue
        offsets, waiting = {start: 0.0}, [start]
        while waiting:
            level = waiting.pop(0)
            for other, metres in sorted(steps[level].items()):
                if other not in offsets:
                    offsets[other] = offsets[level] + float(np.median(metres))
                    waiting.append(other)
        placed |= set(offsets)
        yield {number: offsets[level] for number, level in enumerate(levels) if level in offsets}


def _pairs(files: Sequence[FileBases]) -> Iterator[tuple[tuple[int, int], _Pair]]:
    """Yields what the objects of two files tell, for each two files that touch."""
    cells = _Cells(files)
    if len(np.unique(cells.owners)) < 2:
        return
    one, other = cells.touching()
    if not len(one):
        return
    order = np.lexsort((cells.owners[other], cells.owners[one]))
    one, other = one[order], other[order]
    both = np.column_stack([cells.owners[one], cells.owners[other]])
    starts = np.flatnonzero(np.any(np.diff(both, axis=0, prepend=-1) != 0, axis=1))
    for start, end in zip(starts, [*starts[1:], len(one)], strict=True):
        own, beside = one[start:end], other[start:end]
        fewer = min(int(cells.counts[np.unique(side)].sum()) for side in (own, beside))
        apart_m = np.hypot(*(cells.middles[own] - cells.middles[beside]).T) + (cells.sizes[own] + cells.sizes[beside]) / 2
        least_m = TOLERANCE_M if fewer >= LEAST_OBJECTS else LONE_M
        yield (int(both[start, 0]), int(both[start, 1])), _Pair(cells.heights[own], cells.heights[beside], apart_m, least_m)


class _Cells:
    """The cells of each file: (n,) arrays, in the order of `keys`, which number places."""

    def __init__(self, files: Sequence[FileBases]) -> None:
        bases = np.concatenate([file.bases for file in files]) if files else np.empty((0, 3))
        sizes = np.concatenate([file.sizes for file in files]) if files else np.empty(0)
        owners = np.repeat(np.arange(len(files)), [len(file.bases) for file in files])
        keys = _key(np.floor(bases[:, :2] / CELL_M).astype(np.int64))
        order = np.lexsort((bases[:, 2], owners, keys))
        bases, sizes, owners, keys = bases[order], sizes[order], owners[order], keys[order]
        is_first = np.ones(len(keys), dtype=bool)
        is_first[1:] = (keys[1:] != keys[:-1]) | (owners[1:] != owners[:-1])
        starts = np.flatnonzero(is_first)
        self.counts: Numbers = np.diff(np.append(starts, len(keys)))
        self.keys: Numbers = keys[starts]
        self.owners: Numbers = owners[starts]
        self.heights: Floats = bases[starts + (self.counts - 1) // 2, 2]
        self.sizes: Floats = np.maximum.reduceat(sizes, starts) if len(starts) else np.empty(0)
        self.middles: Floats = np.add.reduceat(bases[:, :2], starts, axis=0) / self.counts[:, None] if len(starts) else np.empty((0, 2))

    def touching(self) -> tuple[Numbers, Numbers]:
        """Returns pairs of cells of different files that are one place or lie beside each other, each pair once."""
        ones, others = [], []
        for shift in (_key(np.array([dx, dy])) for dx in (-1, 0, 1) for dy in (-1, 0, 1)):
            first, end = (np.searchsorted(self.keys, self.keys + shift, side=side) for side in ("left", "right"))
            one = np.repeat(np.arange(len(self.keys)), end - first)
            other = np.arange(len(one)) - np.repeat(np.cumsum(end - first) - (end - first), end - first) + np.repeat(first, end - first)
            is_pair = self.owners[one] < self.owners[other]
            ones.append(one[is_pair])
            others.append(other[is_pair])
        return np.concatenate(ones), np.concatenate(others)


def _key(cells: Numbers) -> Numbers:
    keys: Numbers = cells[..., 0] * (1 << 32) + cells[..., 1]
    return keys
