"""Refuses pyramids with more blocks than planning can hold, before a rendering is created."""

import math
from collections.abc import Sequence
from typing import Final

from map3d.errors import BadRequest
from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import PinnedFrame
from map3d.renderings.plan import PlannedScene
from map3d.tiles.naming import block_levels

MOST_BASE_BLOCKS: Final = 1 << 26
"""Base blocks of a view. Planning takes up to 40 bytes for each, 2.7 GB; a country in eight directions at 0.2 m has 1.5 million per view."""
_COUNTED: Final = 1 << 14
"""Occupied tiles of a level that are counted; deeper levels are estimated from there."""
_FIRST_LEVEL: Final = 5


def check_block_count(scene: PlannedScene, frames: Sequence[PinnedFrame], name: str) -> None:
    """Raises BadRequest if a view has more than `MOST_BASE_BLOCKS` base blocks by estimate. Shallow pyramids cannot, and cost nothing here."""
    for frame in frames:
        blocks = estimate_blocks(scene, frame)
        if blocks <= MOST_BASE_BLOCKS:
            continue
        surplus = math.ceil(math.log(blocks / MOST_BASE_BLOCKS, 4))
        levels, res_m = frame.zmax + 1 - surplus, frame.pixel_m(frame.zmax) * 2**surplus
        raise BadRequest(
            f"rendering {name}: view {frame.id} would have about {blocks:,.0f} base blocks in {frame.zmax + 1} levels, the limit is "
            f"{MOST_BASE_BLOCKS:,}; use at most {levels} levels, that is {res_m:.3g} m per pixel or coarser, or a window around the part "
            "that you need so fine"
        )


def estimate_blocks(scene: PlannedScene, frame: PinnedFrame) -> float:
    """Returns the number of base blocks of a view: exact while there are few, else a surface's fourfold growth from a level to the next."""
    root = block_levels(frame.zmax)[0].root
    if 4**root <= MOST_BASE_BLOCKS:
        return 4.0**root
    core = core_frame(frame.to_json())
    for level in range(_FIRST_LEVEL, root + 1):
        found = len(scene.occupied(core, level))
        if found > _COUNTED or level == root:
            return found * 4.0 ** (root - level)
    raise AssertionError("unreachable: a deep root is below the first level")
