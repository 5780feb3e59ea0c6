"""The render task: has a subprocess render each leased block and commits the block to the track's tile store."""

import threading
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from typing import Any, Final

from map3d.catalogue import JobResult, Lease, RenderingRecord, SceneRecord, Workspace
from map3d.errors import NotFound
from map3d.renderings.block_check import check_rendered
from map3d.scenes.scene_cache import scene_in_use
from map3d.subprocess import Limits, Message, Subprocess
from map3d.tiles.naming import block_level, blocks_below
from map3d.tiles.occupancy import block_bits
from map3d.tiles.tile_store import StoredTile, TileStore
from map3d.tiles.track_stores import open_or_create_track
from map3d.types import BlockId, TileId

RENDER_ENTRY: Final = "map3d.renderings.block_renderer:open_renderer"
CACHE_BYTES: Final = 512 << 20


class RenderTask:
    """Implements `Task`. Opens the tile stores of the rendering's tracks, and creates missing ones.

    `stats` sums the statistics of all committed blocks: seconds of each stage, tiles, cache hits and misses.
    """

    def __init__(
        self,
        workspace: Workspace,
        rendering: RenderingRecord,
        *,
        cache_bytes: int = CACHE_BYTES,
        entry: str = RENDER_ENTRY,
        scene: SceneRecord | None = None,
        limits: Limits | None = None,
    ) -> None:
        """`scene`: its files are fetched if it is shared and was built on another host, and kept until `close`. `limits`: of the subprocesses."""
        workspace.rendering_folder(rendering.name).mkdir(parents=True, exist_ok=True)
        self._workspace = workspace
        self.stats: Counter[str] = Counter()
        self._stats_lock = threading.Lock()
        self._zmax = rendering.zmax
        self._entry, self._limits = entry, limits
        self._setup = _setup(workspace, rendering, cache_bytes)
        with ExitStack() as opened:
            if scene is not None:
                opened.enter_context(scene_in_use(workspace, scene))
            stores = {track.id: opened.enter_context(open_or_create_track(workspace, rendering, track)) for track in rendering.tracks}
            self._opened = opened.pop_all()
        self._stores: Mapping[str, TileStore] = stores

    def start_subprocess(self) -> Subprocess:
        return Subprocess(self._entry, self._setup, limits=self._limits)

    def request(self, lease: Lease) -> Message:
        """Contains everything that a reduce block depends on, so that the subprocess needs neither stores nor credentials."""
        levels = block_level(lease.block.z, self._zmax).levels
        value = {"track": lease.track, "block": list(lease.block), "kind": lease.kind, "levels": levels, "key": lease.key}
        if lease.kind == "base":
            return Message(value, [])
        seams = self._seams_below(lease)
        return Message({**value, "below": [[below.x, below.y] for below in seams]}, list(seams.values()))

    def _seams_below(self, lease: Lease) -> dict[BlockId, bytes]:
        """Returns the seams of the blocks below that have content."""
        store, below = self._stores[lease.track], blocks_below(lease.block, self._zmax)
        seams = store.get_seams(below)
        for block in below:
            stored = None if block in seams else store.get_block(block)
            if stored is not None and stored.tiles:
                raise NotFound(f"block {block} of track {lease.track} has {stored.tiles} tiles but no seam; run map3d verify")
        return seams

    def commit(self, lease: Lease, response: Message) -> JobResult:
        store = self._stores[lease.track]
        tiles, seam = stored_tiles(response)
        check_rendered(store.shape, lease.block, tiles, seam)
        stored = store.put_block(lease.block, lease.key, lease.content_version, tiles, seam, fence=lease.fence)
        with self._stats_lock:
            self.stats.update(response.value.get("stats", {}))
        return JobResult(
            version=stored.version,
            empty=not tiles,
            tiles=len(tiles),
            base_tiles=sum(tile.layer == 0 and tile.z == self._zmax for tile in tiles),
            bytes=sum(len(tile.data) for tile in tiles),
            seconds=float(response.value["seconds"]),
            occupied=block_bits(lease.block, self._zmax, (TileId(*tile[1:4]) for tile in tiles)) if lease.kind == "base" else 0,
        )

    def update_scene(self, scene: SceneRecord) -> None:
        """Fetches the files of a shared scene again if it was built meanwhile; the subprocesses then open it again by themselves."""
        with scene_in_use(self._workspace, scene):
            pass

    def take_stats(self) -> dict[str, float]:
        """Returns `stats` and sets them to zero."""
        with self._stats_lock:
            taken: dict[str, float] = dict(self.stats)
            self.stats.clear()
        return taken

    def close(self) -> None:
        self._opened.close()


def stored_tiles(response: Message) -> tuple[list[StoredTile], bytes | None]:
    """Returns the tiles and the seam of a rendered block."""
    names: list[list[int]] = response.value["tiles"]
    tiles = [StoredTile(layer, z, x, y, data) for (layer, z, x, y), data in zip(names, response.blobs, strict=False)]
    return tiles, response.blobs[len(names)] if response.value["seam"] else None


def _setup(workspace: Workspace, rendering: RenderingRecord, cache_bytes: int) -> dict[str, Any]:
    return {
        "scene": str(workspace.scene_folder(rendering.scene).absolute()),
        "cache_bytes": cache_bytes,
        "frames": {track.id: track.frame.to_json(track.layers) for track in rendering.tracks},
    }
