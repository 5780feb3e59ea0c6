"""Where a map opens: at objects, as near to the middle of the content as there are many, and with some of them in view."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from map3d.registry import Registry
from map3d.types import Box, Vec3

GROUND_CLASSES: Final = (
    "terrain", "tinrelief", "relief_feature", "raster_relief", "breakline_relief", "masspoint_relief", "land_use", "water_body", "plant_cover",
    "road", "railway", "square", "track", "transportation_complex",
)  # fmt: skip
"""Classes of the ground, on which the objects stand that people look for."""
MAX_BOXES: Final = 20_000
"""Largest number of objects that are read; with more, every n-th counts."""
IN_VIEW: Final = 24
"""Number of objects that the first picture shows, or all of fewer."""
_CELLS: Final = 32
"""Along the longer side of the content; objects are counted in 3 × 3 of them."""
_DENSE: Final = 0.25
"""The share of the most objects in 3 × 3 cells that makes a place dense."""
_TOGETHER: Final = 20
"""Few objects are shown together unless the place that they take has this many times their length."""
_WIDE: Final = 0.9
"""An object with a larger share of the content's sides is ground, whatever its class says."""


@dataclass(frozen=True)
class Opening:
    """`position`: local, metres; `radius_m`: of the circle around it that holds the first objects to be seen."""

    position: Vec3
    radius_m: float


def read_objects_box(registry: Registry, content: Box) -> Box | None:
    """Returns the box of all objects, local, as far as it lies within the content; None if there are none."""
    found = registry.union_box(GROUND_CLASSES)
    if found is None:
        return None
    (x0, y0, z0), (x1, y1, z1) = np.clip(found, *content).tolist()
    return (x0, y0, z0), (x1, y1, z1)


def read_opening(registry: Registry, content: Box, position: Vec3 | None = None) -> Opening | None:
    """Returns where the map of a scene opens, at `position` if that is decided; None if there are no objects."""
    step = max(registry.greatest_id() // MAX_BOXES, 1)
    boxes = registry.sample_boxes(GROUND_CLASSES, step)
    return find_opening(boxes, content, max(IN_VIEW // step, 1), position)


def find_opening(boxes: ArrayLike, content: Box, in_view: int = IN_VIEW, position: Vec3 | None = None) -> Opening | None:
    """Returns where a map opens; None if no object lies within the content. `boxes`: (n, 6), lower and upper corners, local metres."""
    low, high = np.array(content[0]), np.array(content[1])
    rows = np.asarray(boxes, np.float64).reshape(-1, 6)
    middles = (rows[:, :3] + rows[:, 3:]) / 2
    kept = ((middles >= low) & (middles <= high)).all(axis=1) & (rows[:, 3:5] - rows[:, :2] < _WIDE * (high - low)[:2]).any(axis=1)
    rows, middles = rows[kept], middles[kept]
    if not len(rows):
        return None
    centre = (low + high) / 2 if position is None else np.array(position)
    if position is not None:
        at = centre
    elif len(rows) <= in_view and _are_together(rows):
        at = np.array([*(rows[:, :2].min(axis=0) + rows[:, 3:5].max(axis=0)) / 2, centre[2]])
    else:
        at = centre if _is_dense(middles, centre, low, high) else _nearest_dense(rows, middles, centre, low, high)
        in_view = min(in_view, max(len(rows) // 2, 1))
    far_m = np.hypot(*np.maximum(np.abs(rows[:, :2] - at[:2]), np.abs(rows[:, 3:5] - at[:2])).T)
    radius_m = float(np.sort(far_m)[min(in_view, len(rows)) - 1])
    x, y, z = (round(float(number), 3) for number in at)
    return Opening((x, y, z), round(radius_m, 3))


def _are_together(rows: NDArray[np.float64]) -> bool:
    lengths = np.hypot(*(rows[:, 3:5] - rows[:, :2]).T)
    return bool(np.hypot(*(rows[:, 3:5].max(axis=0) - rows[:, :2].min(axis=0))) <= _TOGETHER * lengths.sum())


def _counts(middles: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
    """Returns the number of objects in each 3 × 3 cells, (x, y), and the side of a cell."""
    side_m = max(float((high - low)[:2].max()) / _CELLS, 1e-9)
    cells = np.zeros((_CELLS + 2, _CELLS + 2), np.int64)
    index = _cell(middles, low, side_m) + 1
    np.add.at(cells, (index[:, 0], index[:, 1]), 1)
    total = sum(cells[1 + x : _CELLS + 1 + x, 1 + y : _CELLS + 1 + y] for x in (-1, 0, 1) for y in (-1, 0, 1))
    return np.asarray(total), side_m


def _cell(points: NDArray[np.float64], low: NDArray[np.float64], side_m: float) -> NDArray[np.int64]:
    return np.clip(((points[..., :2] - low[:2]) / side_m).astype(np.int64), 0, _CELLS - 1)


def _is_dense(middles: NDArray[np.float64], at: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]) -> bool:
    counts, side_m = _counts(middles, low, high)
    x, y = _cell(at, low, side_m)
    return bool(counts[x, y] >= _DENSE * counts.max())


def _nearest_dense(
    rows: NDArray[np.float64], middles: NDArray[np.float64], centre: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns the middle of the objects around the dense cell nearest to the centre."""
    counts, side_m = _counts(middles, low, high)
    dense = np.argwhere(counts >= _DENSE * counts.max())
    distances = np.hypot(*(low[:2] + (dense + 0.5) * side_m - centre[:2]).T)
    cell = dense[int(np.argmin(distances))]
    around = (np.abs(_cell(middles, low, side_m) - cell) <= 1).all(axis=1)
    x, y = middles[around, :2].mean(axis=0)
    return np.array([x, y, rows[around, 2].mean()])
