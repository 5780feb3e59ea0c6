"""Other renderers, set up as their users would: the same triangles and textures, the same squares of a view, 16 samples a pixel, nothing encoded.

Each is a `Drawer` made in a process of its own (bench/crew.py). One that is not installed raises `Missing`, and the table says so.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Frame = dict[str, Any]
"""Fields of a `_core.Frame`: look_at_deg, pitch_deg, u0_m, v0_m, d0_m, size_m, tile_px, zmax."""


class Missing(Exception):
    """A peer is not installed, or the machine lacks what it needs; the message says what to do."""


class Drawer(Protocol):
    """A scene held ready to be drawn."""

    def draw(self, frame: Frame, x: int, y: int) -> object:
        """Colour, normal, id and depth of tile (x, y) of level zmax, in this process's memory."""

    def centres(self, frame: Frame, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        """id and depth (H, W) in metres from D0, inf where nothing is, at the centres of the pixels: for comparing, not timed."""

    def picture(self, frame: Frame, x: int, y: int) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB as drawn, for looking at."""


def wider(frame: Frame, doublings: int) -> Frame:
    """The frame whose deepest tiles are 2^doublings of the given one's on a side, at the same pixels."""
    return {**frame, "tile_px": frame["tile_px"] << doublings, "zmax": frame["zmax"] - doublings}
