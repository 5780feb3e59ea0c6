"""Finds the objects near a position: small orthographic views of its surroundings from six sides."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.types import Vec3

SIDE_PX: Final = 65
"""Odd, so that the centre of a pixel meets the position itself."""
LEAST_M: Final = 0.01
_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SIDES: Final[tuple[tuple[Vec3, Vec3, Vec3], ...]] = (
    (_X, _Y, (0.0, 0.0, -1.0)),
    ((-1.0, 0.0, 0.0), _Y, _Z),
    (_X, _Z, _Y),
    ((-1.0, 0.0, 0.0), _Z, (0.0, -1.0, 0.0)),
    ((0.0, -1.0, 0.0), _Z, _X),
    (_Y, _Z, (-1.0, 0.0, 0.0)),
)
"""Right, up and forward of each view."""


def find_nearby(scene: _core.Scene, position: Vec3, tolerance_m: float, chosen: NDArray[np.uint32] | None) -> list[list[float]]:
    """Returns [id, distance in metres] of each object with a visible surface within the tolerance, nearest first.

    `chosen`: the ids of the objects to consider, None for all. Distances are exact to a pixel of the views.
    """
    reach_m = max(tolerance_m, LEAST_M)
    nearest: dict[int, float] = {}
    for right, up, forward in SIDES:
        arrays = scene.render_view(
            _camera(position, right, up, forward, reach_m), [_core.LayerSpec("id", "png"), _core.LayerSpec("depth", "png")], samples=1, objects=chosen
        )
        for number, distance_m in _distances(arrays["id"], arrays["depth"], reach_m).items():
            nearest[number] = min(distance_m, nearest.get(number, math.inf))
    half_pixel_m = reach_m / SIDE_PX
    return [
        [number, distance] for number, distance in sorted(nearest.items(), key=lambda item: (item[1], item[0])) if distance <= reach_m + half_pixel_m
    ]


def _camera(position: Vec3, right: Vec3, up: Vec3, forward: Vec3, reach_m: float) -> _core.Camera:
    """Returns a view of the cube around the position; depths are relative to the position."""
    window = (-reach_m, reach_m, -reach_m, reach_m)
    return _core.Camera("orthographic", position, right, up, forward, window, -reach_m, reach_m, SIDE_PX, SIDE_PX)


def _distances(ids: NDArray[np.uint32], depth: NDArray[np.float32], reach_m: float) -> dict[int, float]:
    """Returns the least distance of each object of a view from the position."""
    side = (np.arange(SIDE_PX) - SIDE_PX // 2) * (2 * reach_m / SIDE_PX)
    distance = np.sqrt(side[None, :] ** 2 + side[:, None] ** 2 + depth.astype(np.float64) ** 2)
    covered = ids != 0
    found: dict[int, float] = {}
    for number, metres in zip(ids[covered].tolist(), distance[covered].tolist(), strict=True):
        found[number] = min(metres, found.get(number, math.inf))
    return found
