"""The views of `python -m bench view`."""

from typing import Any

import numpy as np

from map3d import _core

SIZE = (1024, 768)
VIEWS = ("orthographic", "orthographic, level", "perspective, air", "perspective, street")


def view_camera(scene: _core.Scene, name: str) -> _core.Camera:
    """Returns an oblique or a level orthographic view of 0.2 m per pixel, one from the air in perspective, or one near the ground."""
    lo, hi = (np.array(corner) for corner in scene.box)
    middle = (lo + hi) / 2
    match name:
        case "orthographic":
            return camera("orthographic", middle, (0.0, 1.0, -1.0), 102.4)
        case "orthographic, level":
            return camera("orthographic", middle, (0.2, 1.0, 0.0), 102.4)
        case "perspective, air":
            return camera("perspective", (middle[0], middle[1] - 250.0, hi[2] + 60.0), (0.1, 1.0, -0.4), 0.6)
        case "perspective, street":
            return camera("perspective", (middle[0], middle[1] - 120.0, middle[2]), (0.1, 1.0, 0.0), 0.7)
        case _:
            raise ValueError(name)


def camera(projection: Any, position: Any, forward: tuple[float, float, float], half: float) -> _core.Camera:
    ahead = np.array(forward) / np.linalg.norm(forward)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    high = half * SIZE[1] / SIZE[0]
    near_m = 0.5 if projection == "perspective" else -5_000.0
    vectors = [tuple(float(c) for c in v) for v in (position, right, up, ahead)]
    return _core.Camera(projection, *vectors, (-half, half, -high, high), near_m, 20_000.0, *SIZE)  # type: ignore[arg-type]
