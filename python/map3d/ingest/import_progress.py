"""Formats the progress of an import: what was read, and for terrain the rate and the remaining time."""

import time
from collections import deque
from collections.abc import Mapping
from typing import Final

from map3d.quantities import time_text

WINDOW_S: Final = 60.0


class ImportProgress:
    """Measures the rate of the last `WINDOW_S`, so that checkpoints of a killed import soon do not count."""

    def __init__(self) -> None:
        self._reports: deque[tuple[float, int]] = deque()

    def text(self, counts: Mapping[str, int]) -> str:
        """`counts`: {"triangles"} or {"done", "total"}, in tiles of terrain."""
        if "triangles" in counts:
            return f"{counts['triangles']:,} triangles"
        done, total, now = counts["done"], counts["total"], time.monotonic()
        self._reports.append((now, done))
        while now - self._reports[0][0] > WINDOW_S and len(self._reports) > 2:
            self._reports.popleft()
        elapsed_s, since = now - self._reports[0][0], done - self._reports[0][1]
        parts = [f"{done:,} of {total:,} tiles"]
        if since and elapsed_s:
            rate = since / elapsed_s
            parts += [f"{rate:,.1f}/s", f"{time_text((total - done) / rate)} left"]
        return ", ".join(parts)
