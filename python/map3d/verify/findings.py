"""The problems that a verification found."""

from dataclasses import dataclass, field
from typing import Final

from map3d.types import BlockId

MAX_LINES: Final = 1000


@dataclass
class Findings:
    """`wrong`: the first MAX_LINES problems, one line each: where, found, expected. `total`: the number of all problems. `counted`: the number of
    checked things by kind. `blocks`: (track, block) of all problems that re-rendering the block fixes."""

    wrong: list[str] = field(default_factory=list)
    total: int = 0
    counted: dict[str, int] = field(default_factory=dict)
    blocks: set[tuple[str, BlockId]] = field(default_factory=set)

    def add(self, line: str, track: str | None = None, *blocks: BlockId) -> None:
        """Adds a problem, and the blocks of `track` that have it."""
        self.total += 1
        if track is not None:
            self.blocks |= {(track, block) for block in blocks}
        if len(self.wrong) < MAX_LINES:
            self.wrong.append(line)

    def count(self, kind: str, number: int = 1) -> None:
        self.counted[kind] = self.counted.get(kind, 0) + number
