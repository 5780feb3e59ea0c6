"""The problems that a verification found."""

from dataclasses import dataclass, field
from typing import Final

MAX_LINES: Final = 1000


@dataclass
class Findings:
    """`wrong`: the first MAX_LINES problems, one line each: where, found, expected. `total`: the number of all problems. `counted`: the number of
    checked things by kind."""

    wrong: list[str] = field(default_factory=list)
    total: int = 0
    counted: dict[str, int] = field(default_factory=dict)

    def add(self, line: str) -> None:
        self.total += 1
        if len(self.wrong) < MAX_LINES:
            self.wrong.append(line)

    def count(self, kind: str, number: int = 1) -> None:
        self.counted[kind] = self.counted.get(kind, 0) + number
