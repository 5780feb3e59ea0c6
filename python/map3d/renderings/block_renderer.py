"""The subprocess of a render worker: renders base blocks of the scene and reduces seams to reduce blocks. Keeps the scene open between requests.

Imports no NumPy, which would take most of the time to start.
"""

import time
from collections.abc import Mapping, Sequence
from typing import Any, Final

from map3d import _core
from map3d.errors import StalePlan
from map3d.geometry.core_frame import core_frame
from map3d.subprocess import Handler, ReportProgress
from map3d.types import BlockId

COUNTED: Final = ("chunk_hits", "chunk_misses", "texture_hits", "texture_misses", "texture_decoded", "texture_evicted")


def open_renderer(setup: Mapping[str, Any]) -> Handler:
    """`setup`: {"scene": folder, "cache_bytes", "frames": {track: frame}}.

    A request for a reduce block has the seams of the blocks below as byte strings, and their columns and rows under "below".
    """
    renderer = _BlockRenderer(setup)

    def handle(request: dict[str, Any], blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        started = time.perf_counter()
        if request["kind"] == "base":
            block = renderer.render(request["track"], BlockId(*request["block"]), request["key"])
        else:
            seams = [(x, y, seam) for (x, y), seam in zip(request["below"], blobs, strict=True)]
            block = renderer.reduce(request["track"], BlockId(*request["block"]), request["levels"], seams)
        tiles, seam = block.tiles, block.seam
        stats = {**block.stats, **renderer.take_cache_counts()}
        response = {"tiles": [list(tile[:4]) for tile in tiles], "seam": seam is not None, "stats": stats}
        blobs = [tile[4] for tile in tiles] + ([] if seam is None else [seam])
        return {**response, "seconds": time.perf_counter() - started}, blobs

    return handle


class _BlockRenderer:
    def __init__(self, setup: Mapping[str, Any]) -> None:
        self._setup = setup
        self._scene = self._open_scene()
        self._frames = {track: core_frame(frame) for track, frame in setup["frames"].items()}
        self._counted = dict.fromkeys(COUNTED, 0)

    def render(self, track: str, block: BlockId, key: str) -> _core.Block:
        """Renders a base block from the scene from which `key` was computed. Raises StalePlan when the scene has changed since."""
        return self._render_current(track, block, key) or self._render_reopened(track, block, key)

    def reduce(self, track: str, block: BlockId, levels: int, seams: list[tuple[int, int, bytes]]) -> _core.Block:
        """Reduces the seams (x, y, bytes) of the blocks below to a reduce block."""
        return _core.reduce_block(self._frames[track], *block, levels, seams)

    def _render_current(self, track: str, block: BlockId, key: str) -> _core.Block | None:
        """Renders a base block from the open scene; returns None when that is another scene than the one that was planned."""
        frame = self._frames[track]
        try:
            return self._scene.render_block(frame, *block) if self._scene.block_key(frame, *block) == key else None
        except _core.SceneRebuilt:
            return None

    def _render_reopened(self, track: str, block: BlockId, key: str) -> _core.Block:
        self._scene, self._counted = self._open_scene(), dict.fromkeys(COUNTED, 0)
        rendered = self._render_current(track, block, key)
        if rendered is None:
            raise StalePlan(f"block {block} of track {track}: the scene has changed since the block was planned")
        return rendered

    def _open_scene(self) -> _core.Scene:
        return _core.Scene(self._setup["scene"], cache_bytes=self._setup["cache_bytes"])

    def take_cache_counts(self) -> dict[str, int]:
        """Returns the counts of the scene's caches since the previous call."""
        before, now = self._counted, self._scene.stats()
        self._counted = {name: now[name] for name in COUNTED}
        return {name: self._counted[name] - before[name] for name in COUNTED}
