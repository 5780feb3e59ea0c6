"""Computes the boxes of objects from a mesh, and of parents from their children."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from map3d.types import Box


def object_boxes(points: NDArray[np.float64], triangles: NDArray[np.uint32], objects: NDArray[np.uint32], count: int) -> NDArray[np.float64]:
    """Returns (count, 2, 3) lower and upper corners for (n, 3) points, (t, 3) triangles and (t,) object indices; +inf, −inf without triangles."""
    boxes = np.empty((count, 2, 3), dtype=np.float64)
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    if len(triangles) == 0:
        return boxes
    order = np.argsort(objects, kind="stable")
    numbers, starts = np.unique(objects[order], return_index=True)
    corners = points[triangles[order]]
    boxes[numbers, 0] = np.minimum.reduceat(corners.min(axis=1), starts)
    boxes[numbers, 1] = np.maximum.reduceat(corners.max(axis=1), starts)
    return boxes


def unite_boxes(a: Box | None, b: Box | None) -> Box | None:
    """Returns the smallest box that contains both."""
    if a is None or b is None:
        return a or b
    low = tuple(min(pair) for pair in zip(a[0], b[0], strict=True))
    high = tuple(max(pair) for pair in zip(a[1], b[1], strict=True))
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def include_children(boxes: Mapping[int, Box | None], parents: Mapping[int, int]) -> dict[int, Box | None]:
    """Extends the box of every object by those of all its descendants. Cycles of parents are broken."""
    extended = dict(boxes)
    for number, box in boxes.items():
        seen = {number}
        above = parents.get(number)
        while above is not None and above not in seen:
            extended[above] = unite_boxes(extended.get(above), box)
            seen.add(above)
            above = parents.get(above)
    return extended
