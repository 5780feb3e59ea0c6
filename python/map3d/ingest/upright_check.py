"""Notices a model that lies on its side: as tall as a town is wide, but hardly deeper than a building is high."""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d.ingest.findings import finding

MIN_HEIGHT_M: Final = 100.0
TIMES_DEPTH: Final = 3.0


class UprightCheck:
    """Collects the box of all positions of a document and warns if the model seems to lie on its side."""

    def __init__(self) -> None:
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)

    def add(self, positions: NDArray[np.float64]) -> None:
        finite = positions[np.isfinite(positions).all(axis=1)]
        if len(finite):
            self._low, self._high = np.minimum(self._low, finite.min(axis=0)), np.maximum(self._high, finite.max(axis=0))

    def hints(self, path: str) -> list[dict[str, Any]]:
        """Returns a warning, as it is in a report, if width and height are much greater than the depth."""
        width, depth, height = (float(side) for side in self._high - self._low)
        if not (np.isfinite([width, depth, height]).all() and height > MIN_HEIGHT_M and min(width, height) > TIMES_DEPTH * depth):
            return []
        example = f"{Path(path).name} is {width:,.0f} m wide, {depth:,.0f} m deep and {height:,.0f} m high; give --up y if it should stand upright"
        return [finding("model-on-its-side", 1, example)]
