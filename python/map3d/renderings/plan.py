"""Which blocks a rendering needs, with the keys that tell whether they changed (spec/pyramid.md §8, spec/catalogue.md)."""

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from map3d.catalogue import PlannedJob, RenderingRecord, Track
from map3d.errors import LimitExceeded, OutsideFrame
from map3d.geometry.frames import PinnedFrame, check_content
from map3d.tiles.naming import block_above, block_level, block_levels, morton
from map3d.tiles.occupancy import Occupancy
from map3d.types import BlockId, Box

MAX_PLAN_LEVEL: Final = 14
"""Of a grid of flags; 2^14 squared are 268 MB."""


class PlannedScene(Protocol):
    """What planning asks of a built scene."""

    @property
    def box(self) -> Box: ...

    def occupied(self, frame: str, level: int, within: tuple[int, NDArray[np.uint32]] | None = None) -> NDArray[np.bool_]: ...

    def block_keys(self, frame: str, z: int, blocks: NDArray[np.uint32]) -> list[str]: ...


def plan_jobs(
    scene: PlannedScene, rendering: RenderingRecord, known: Mapping[str, Collection[BlockId]], progress: Callable[[int, int], None] | None = None
) -> list[PlannedJob]:
    """Every block that has or had content, of all tracks. `known`: track → base blocks that were planned before; `progress` counts views.

    Raises OutsideFrame when content has left the pinned square, LimitExceeded for a plan too large.
    """
    jobs: list[PlannedJob] = []
    for done, frame in enumerate(rendering.frames):
        if progress is not None:
            progress(done, len(rendering.frames))
        occupied = _occupied_blocks(scene, rendering, frame)
        for track in rendering.tracks_of(frame):
            blocks = sorted(occupied | set(known.get(track.id, ())), key=lambda block: morton(block.x, block.y))
            keys = scene.block_keys(frame_text(track), block_levels(frame.zmax)[0].root, _places(blocks))
            jobs += _with_reduces(track, dict(zip(blocks, keys, strict=True)))
    return jobs


def frame_text(track: Track) -> str:
    """The frame with the layers of its pass as the core takes it."""
    return json.dumps(track.frame.to_json(track.layers))


def planned_occupancy(
    scene: PlannedScene, rendering: RenderingRecord, frame: PinnedFrame, level: int | None = None, within: Collection[BlockId] | None = None
) -> Occupancy:
    """Conservative: every tile that may have content. `level`: the deepest to tell, zmax unless given; `within`: only in these base blocks."""
    depth = frame.zmax if level is None else level
    if depth > MAX_PLAN_LEVEL:
        raise LimitExceeded(f"rendering {rendering.name}: level {depth} is too deep to plan at once, at most {MAX_PLAN_LEVEL}; use a coarser --res")
    text = json.dumps(frame.to_json())
    if within is None:
        return Occupancy.from_grid(scene.occupied(text, depth))
    return Occupancy.from_grid(scene.occupied(text, depth, (block_levels(frame.zmax)[0].root, _places(within))))


def _places(blocks: Iterable[BlockId]) -> NDArray[np.uint32]:
    """(n, 2) columns and rows."""
    return np.array([(block.x, block.y) for block in blocks], np.uint32).reshape(-1, 2)


def settings_hash(track: Track) -> str:
    """Of what reduce blocks depend on besides the blocks below."""
    layers = [[layer.kind, layer.format, layer.quality, layer.small] for layer in track.layers]
    return hashlib.sha256(json.dumps([layers, track.frame.tile_px, track.frame.zmax]).encode()).hexdigest()


def _occupied_blocks(scene: PlannedScene, rendering: RenderingRecord, frame: PinnedFrame) -> set[BlockId]:
    """Base blocks that may have content. Raises OutsideFrame."""
    try:
        check_content(frame, scene.box, rendering.window)
    except OutsideFrame as error:
        raise OutsideFrame(f"rendering {rendering.name}: {error}") from error
    root = block_levels(frame.zmax)[0].root
    return {BlockId(*tile) for tile in planned_occupancy(scene, rendering, frame, root).tiles(root)}


def _with_reduces(track: Track, base: Mapping[BlockId, str]) -> list[PlannedJob]:
    """The base blocks and all reduce blocks above them; a reduce block's key is made of those below it."""
    jobs: list[PlannedJob] = []
    keys, settings, zmax = dict(base), settings_hash(track), track.frame.zmax
    while keys:
        above: dict[BlockId, list[tuple[BlockId, str]]] = {}
        for block, key in sorted(keys.items(), key=lambda item: morton(item[0].x, item[0].y)):
            parent = block_above(block, zmax)
            jobs.append(PlannedJob(track.id, block, block_level(block.z, zmax).kind, morton(block.x, block.y), key, parent))
            if parent is not None:
                above.setdefault(parent, []).append((block, key))
        keys = {block: hashlib.sha256(json.dumps([settings, below]).encode()).hexdigest()[:32] for block, below in above.items()}
    return jobs
