"""Other renderers, set up as their users would: the same triangles, textures and tiles, 16 samples per pixel, no encoding.

Each is a `PeerRenderer` in its own process (bench/renderer_pool.py). It raises `PeerMissing` if it is not installed.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

FrameFields = dict[str, Any]
"""Fields of a `_core.Frame`: look_at_deg, pitch_deg, u0_m, v0_m, d0_m, size_m, tile_px, zmax."""


class PeerMissing(Exception):
    """A peer or one of its requirements is not installed. The message says what to do."""


class PeerRenderer(Protocol):
    """A renderer with a loaded scene."""

    def draw(self, frame: FrameFields, x: int, y: int) -> object:
        """Draws colour, normal, id and depth of tile (x, y) of level zmax into this process's memory."""

    def centres(self, frame: FrameFields, x: int, y: int) -> tuple[NDArray[np.uint32], NDArray[np.float64]]:
        """Returns ids and depths (H, W) at pixel centres, in metres from D0, inf without hit; for comparison, not timed."""

    def picture(self, frame: FrameFields, x: int, y: int) -> NDArray[np.uint8]:
        """Returns the drawn image, (H, W, 3) sRGB."""


def with_larger_tiles(frame: FrameFields, doublings: int) -> FrameFields:
    """Returns the frame with deepest tiles of 2^doublings tiles per side, at the same resolution."""
    return {**frame, "tile_px": frame["tile_px"] << doublings, "zmax": frame["zmax"] - doublings}
