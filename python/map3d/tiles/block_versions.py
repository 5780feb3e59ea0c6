"""Versions of blocks as the manifest gives them: one for most, and a list of the others (spec/manifest.md)."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Self

import numpy as np

from map3d.types import BlockId


@dataclass(frozen=True)
class BlockVersions:
    """The version of every block of a view and pass: `common`, unless `others` names it."""

    common: int = 1
    others: Mapping[BlockId, int] = field(default_factory=dict)

    @classmethod
    def of(cls, versions: Iterable[tuple[BlockId, int]]) -> Self:
        """Creates it from the versions of all blocks, in 32 bytes per block while it reads them. `common` is the greatest of the most common ones, 1
        without blocks."""
        rows = np.fromiter(chain.from_iterable((*block, version) for block, version in versions), np.int64).reshape(-1, 4)
        counts = Counter(rows[:, 3].tolist())
        common = max(counts, key=lambda version: (counts[version], version), default=1)
        return cls(common, {BlockId(z, x, y): version for z, x, y, version in rows[rows[:, 3] != common].tolist()})

    def __getitem__(self, block: BlockId) -> int:
        return self.others.get(block, self.common)
