"""The subprocess of a render worker: renders base blocks of the scene and reduces seams to reduce blocks. Keeps the scene open between requests."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from map3d import _core
from map3d.errors import NotFound
from map3d.geometry.frames import core_frame
from map3d.subprocess import Handler, ReportProgress
from map3d.tiles.naming import blocks_below
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId

COUNTED: Final = ("chunk_hits", "chunk_misses", "texture_hits", "texture_misses", "texture_decoded", "texture_evicted")


def open_renderer(setup: Mapping[str, Any]) -> Handler:
    """`setup`: {"scene": folder, "cache_bytes", "frames": {track: frame}, "stores": {track: path}}."""
    renderer = _BlockRenderer(setup)

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], Sequence[bytes]]:
        started = time.perf_counter()
        block = renderer.render(request["track"], BlockId(*request["block"]), request["kind"], request["levels"])
        tiles, seam = block.tiles, block.seam
        stats = {**block.stats, **renderer.take_cache_counts()}
        response = {"tiles": [list(tile[:4]) for tile in tiles], "seam": seam is not None, "stats": stats}
        blobs = [tile[4] for tile in tiles] + ([] if seam is None else [seam])
        return {**response, "seconds": time.perf_counter() - started}, blobs

    return handle


class _BlockRenderer:
    def __init__(self, setup: Mapping[str, Any]) -> None:
        self._scene = _core.Scene(setup["scene"], cache_bytes=setup["cache_bytes"])
        self._frames = {track: core_frame(frame) for track, frame in setup["frames"].items()}
        self._paths = {track: Path(path) for track, path in setup["stores"].items()}
        self._stores: dict[str, SqliteTileStore] = {}
        self._counted = dict.fromkeys(COUNTED, 0)

    def render(self, track: str, block: BlockId, kind: str, levels: int) -> _core.Block:
        if kind == "base":
            return self._scene.render_block(self._frames[track], *block)
        return _core.reduce_block(self._frames[track], *block, levels, self._seams_below(track, block))

    def take_cache_counts(self) -> dict[str, int]:
        """Returns the counts of the scene's caches since the previous call."""
        before, now = self._counted, self._scene.stats()
        self._counted = {name: now[name] for name in COUNTED}
        return {name: self._counted[name] - before[name] for name in COUNTED}

    def _seams_below(self, track: str, block: BlockId) -> list[tuple[int, int, bytes]]:
        """Returns (x, y, seam) of each block below that has content."""
        store = self._store(track)
        seams = []
        for below in blocks_below(block, self._frames[track].zmax):
            stored, seam = store.get_block(below), store.get_seam(below)
            if seam is not None:
                seams.append((below.x, below.y, seam))
            elif stored is not None and stored.tiles:
                raise NotFound(f"block {below} of track {track} has {stored.tiles} tiles but no seam; run map3d verify")
        return seams

    def _store(self, track: str) -> SqliteTileStore:
        if track not in self._stores:
            self._stores[track] = SqliteTileStore(self._paths[track], read_only=True)
        return self._stores[track]
