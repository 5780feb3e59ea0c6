"""Measures the progress of an import: what was read, and for terrain the rate and the remaining time."""

import time
from collections import deque
from collections.abc import Mapping
from typing import Final

from map3d.messages import Message, message

WINDOW_S: Final = 60.0


class ImportProgress:
    """Measures the rate of the last `WINDOW_S`, so that checkpoints of a killed import soon do not count."""

    def __init__(self) -> None:
        self._reports: deque[tuple[float, int]] = deque()

    def message(self, counts: Mapping[str, int]) -> Message:
        """`counts`: {"triangles"} or {"done", "total"}, in tiles of terrain."""
        if "triangles" in counts:
            return message("triangle", count=counts["triangles"])
        done, total, now = counts["done"], counts["total"], time.monotonic()
        self._reports.append((now, done))
        while now - self._reports[0][0] > WINDOW_S and len(self._reports) > 2:
            self._reports.popleft()
        elapsed_s, since = now - self._reports[0][0], done - self._reports[0][1]
        if not since or not elapsed_s:
            return message("tiles-done", done=done, total=total)
        rate = since / elapsed_s
        return message("tiles-done-with-rate", done=done, total=total, rate=round(rate, 1), left=(total - done) / rate)
