"""What a check found wrong."""

from dataclasses import dataclass, field
from typing import Final

MAX_LINES: Final = 1000


@dataclass
class Findings:
    """`wrong`: one line each that says where, what is there and what should be; the first MAX_LINES, `total` counts all. `counted`: what was looked
    at."""

    wrong: list[str] = field(default_factory=list)
    total: int = 0
    counted: dict[str, int] = field(default_factory=dict)

    def add(self, line: str) -> None:
        self.total += 1
        if len(self.wrong) < MAX_LINES:
            self.wrong.append(line)

    def count(self, what: str, number: int = 1) -> None:
        self.counted[what] = self.counted.get(what, 0) + number
