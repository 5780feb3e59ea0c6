"""Plans the blocks of a rendering, with keys that change when their content does (spec/pyramid.md §8, spec/catalogue.md)."""

import hashlib
import json
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.catalogue import PlannedJob, RenderingRecord, Track
from map3d.errors import OutsideFrame
from map3d.geometry.frames import PinnedFrame, check_content, core_frame
from map3d.tiles.naming import block_above, block_level, block_levels, morton
from map3d.tiles.occupancy import Occupancy
from map3d.types import BlockId, Box


class PlannedScene(Protocol):
    """The part of `_core.Scene` that planning uses."""

    @property
    def box(self) -> Box: ...

    def occupied(self, frame: _core.Frame, level: int, within: tuple[int, NDArray[np.uint32]] | None = None) -> NDArray[np.uint64]: ...

    def block_keys(self, frame: _core.Frame, z: int, blocks: NDArray[np.uint32]) -> list[str]: ...


def plan_jobs(
    scene: PlannedScene, rendering: RenderingRecord, known: Mapping[str, Collection[BlockId]], progress: Callable[[int, int], None] | None = None
) -> list[PlannedJob]:
    """Returns every block that has or had content, of all tracks. `known`: track → base blocks of earlier plans; `progress` counts views.

    Raises OutsideFrame when content has left the pinned square.
    """
    jobs: list[PlannedJob] = []
    for done, frame in enumerate(rendering.frames):
        if progress is not None:
            progress(done, len(rendering.frames))
        occupied = _occupied_blocks(scene, rendering, frame)
        for track in rendering.tracks_of(frame):
            blocks = sorted(occupied | set(known.get(track.id, ())), key=lambda block: morton(block.x, block.y))
            keys = scene.block_keys(track_frame(track), block_levels(frame.zmax)[0].root, _columns_and_rows(blocks))
            jobs += _with_reduces(track, dict(zip(blocks, keys, strict=True)))
    return jobs


def track_frame(track: Track) -> _core.Frame:
    """Returns a view's frame with the layers of the track's pass."""
    return core_frame(track.frame.to_json(track.layers))


def planned_occupancy(scene: PlannedScene, frame: PinnedFrame, level: int | None = None, within: Collection[BlockId] | None = None) -> Occupancy:
    """Returns, conservatively, every tile that may have content. `level`: the deepest, by default zmax; `within`: only in these base blocks.

    Time and memory grow with the occupied tiles, at any level.
    """
    depth = frame.zmax if level is None else level
    blocks = None if within is None else (block_levels(frame.zmax)[0].root, _columns_and_rows(within))
    return Occupancy(depth, scene.occupied(core_frame(frame.to_json()), depth, blocks))


def _columns_and_rows(blocks: Iterable[BlockId]) -> NDArray[np.uint32]:
    """(n, 2) columns and rows."""
    return np.array([(block.x, block.y) for block in blocks], np.uint32).reshape(-1, 2)


def settings_hash(track: Track) -> str:
    """Returns the hash of everything that reduce blocks depend on besides the blocks below."""
    layers = [[layer.kind, layer.format, layer.quality, layer.small] for layer in track.layers]
    return hashlib.sha256(json.dumps([layers, track.frame.tile_px, track.frame.zmax]).encode()).hexdigest()


def _occupied_blocks(scene: PlannedScene, rendering: RenderingRecord, frame: PinnedFrame) -> set[BlockId]:
    """Returns the base blocks that may have content; raises OutsideFrame."""
    try:
        check_content(frame, scene.box, rendering.window)
    except OutsideFrame as error:
        raise OutsideFrame(f"rendering {rendering.name}: {error}") from error
    root = block_levels(frame.zmax)[0].root
    return {BlockId(*tile) for tile in planned_occupancy(scene, frame, root).tiles(root)}


def _with_reduces(track: Track, base: Mapping[BlockId, str]) -> list[PlannedJob]:
    """Returns the base blocks and all reduce blocks above them; a reduce block's key hashes the keys of the blocks below."""
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
