"""Checks of one track's tile store: every block, tile and seam."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.catalogue import Catalogue, Job, RenderingRecord, State, Track, Workspace
from map3d.errors import Corrupt, Map3dError, StoreError
from map3d.renderings.plan import planned_occupancy, track_frame
from map3d.tiles.decode_tile import decode_tile
from map3d.tiles.naming import block_level, block_of, blocks_below, children, parent
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.tile_store import StoredBlock, TileStore
from map3d.tiles.track_stores import find_track, track_url
from map3d.types import BlockId, TileId
from map3d.verify.findings import Findings

Progress = Callable[[str, int, int], None]


def check_track(
    workspace: Workspace,
    catalogue: Catalogue,
    record: RenderingRecord,
    track: Track,
    scene: _core.Scene,
    ids: NDArray[np.uint32],
    findings: Findings,
    progress: Progress,
) -> set[TileId] | None:
    """Checks one track. `ids`: the sorted ids of all registered objects. Returns the stored tiles, None when no block is done."""
    jobs = {job.block: job for job in catalogue.jobs(record.name, track.id)}
    found = find_track(workspace, record, track.id)
    if found is None:
        if done := [block for block, job in jobs.items() if job.state is State.DONE]:
            findings.add(f"{track_url(workspace, record, track.id)}: missing, although jobs of this track are done", track.id, *done)
        return None
    with found as store:
        checker = _TrackChecker(f"{record.name} {track.id}", store, track, jobs, findings, progress)
        for fault in store.check():
            findings.add(f"{store.url}: {fault.text}", track.id, *fault.blocks)
        try:
            tiles = checker.check_all(planned_occupancy(scene, track.frame), ids)
        except (Corrupt, StoreError) as error:
            findings.add(f"{checker.where}: cannot read all tiles: {error}")
            return None
    return tiles if any(job.state is State.DONE for job in jobs.values()) else None


@dataclass
class _TrackChecker:
    where: str
    store: TileStore
    track: Track
    jobs: Mapping[BlockId, Job]
    findings: Findings
    progress: Progress

    def check_all(self, planned: Occupancy, ids: NDArray[np.uint32]) -> set[TileId]:
        """Returns the stored tiles. Raises Corrupt, StoreError when the store cannot be read."""
        self.check_blocks()
        tiles = self.collect_tiles()
        self.check_pyramid(tiles, planned)
        self.check_images(tiles, ids)
        self.check_reduce_blocks()
        return tiles

    def check_blocks(self) -> None:
        """Checks that done jobs and stored blocks match in key, version and number of tiles, and that seams are intact."""
        stored = {block.id: block for block in self.store.list_blocks()}
        for block, job in self.jobs.items():
            if job.state is State.DONE:
                self._check_block(job, stored.get(block))
        for block in stored.keys() - self.jobs.keys():
            self._add(f"block {block}: stored without a job")

    def _check_block(self, job: Job, stored: StoredBlock | None) -> None:
        where, result = f"block {job.block}", job.result
        if stored is None or result is None:
            self._add(f"{where}: done but not stored; run map3d jobs repair {job.rendering}", job.block)
            return
        if (stored.key, stored.version, stored.tiles) != (job.key, result.version, result.tiles):
            found = f"{stored.key} v{stored.version} with {stored.tiles} tiles"
            expected = f"{job.key} v{result.version} with {result.tiles} tiles"
            self._add(f"{where}: the store has {found}, the catalogue says {expected}", job.block)
        seam = self.store.get_seam(job.block)
        if (seam is None) != (stored.tiles == 0):
            self._add(f"{where}: {stored.tiles} tiles and {'no' if seam is None else 'a'} seam", job.block)
        elif seam is not None:
            self._try(job.block, lambda: _core.check_seam(track_frame(self.track), seam))
            self.findings.count("seams")

    def collect_tiles(self) -> set[TileId]:
        """Returns the stored tiles and checks that all layers have the same."""
        sets = [set(self.store.list_tiles(layer)) for layer in range(len(self.track.layers))]
        for layer, names in zip(self.track.layers, sets, strict=True):
            for tile in sorted(names ^ sets[0]):
                self._add(f"{_name(tile)}: exists in only one of the layers {layer.name} and {self.track.layers[0].name}", self._block_of(tile))
        return set.union(*sets)

    def check_pyramid(self, tiles: set[TileId], planned: Occupancy) -> None:
        """Checks that every tile has its parent, every tile above level zmax has a child, and base tiles exist only where the scene has content."""
        for tile in sorted(tiles):
            above = parent(tile)
            if above is not None and above not in tiles and self._is_done(above):
                self._add(f"{_name(tile)}: its parent is missing", self._block_of(above))
            if tile.z < self.track.frame.zmax:
                if not any(child in tiles for child in children(tile)):
                    self._add(f"{_name(tile)}: has content, but none of its children has", self._block_of(tile))
            elif tile not in planned:
                self._add(f"{_name(tile)}: has content where the scene has none", self._block_of(tile))

    def check_images(self, tiles: set[TileId], ids: NDArray[np.uint32]) -> None:
        """Checks that every tile of every layer decodes to its size and that every id is registered."""
        for done, tile in enumerate(sorted(tiles), 1):
            for number, layer in enumerate(self.track.layers):
                data = self.store.get_tile(number, *tile)
                if data is None:
                    continue
                try:
                    pixels = decode_tile(layer, data, self.track.frame.tile_px)
                except Corrupt as error:
                    self._add(f"{_name(tile)} {layer.name}: {error}", self._block_of(tile))
                    continue
                if "id" in pixels and tile.z == self.track.frame.zmax:
                    self._check_ids(tile, np.setdiff1d(pixels["id"][pixels["id"] != 0], ids))
            if done % 64 == 0 or done == len(tiles):
                self.progress(f"tiles of {self.where}", done, len(tiles))
        self.findings.count("tiles", len(tiles))
        self.findings.count("images", len(tiles) * len(self.track.layers))

    def check_reduce_blocks(self) -> None:
        """Reduces every done reduce block again from its seams, and compares the result with the stored tiles."""
        frame = track_frame(self.track)
        for block, job in self.jobs.items():
            if job.kind == "reduce" and job.state is State.DONE:
                seams = [
                    (below.x, below.y, seam)
                    for below in blocks_below(block, self.track.frame.zmax)
                    if (seam := self.store.get_seam(below)) is not None
                ]
                levels = block_level(block.z, self.track.frame.zmax).levels
                self._try(block, lambda: self._compare(block, _core.reduce_block(frame, *block, levels, seams)))  # noqa: B023
                self.findings.count("reduced blocks")

    def _compare(self, block: BlockId, reduced: _core.Block) -> None:
        for layer, z, x, y, data in reduced.tiles:
            if self.store.get_tile(layer, z, x, y) != data:
                self._add(f"{z}/{x}/{y} {self.track.layers[layer].name}: differs from the reduced seams", block)
        if self.store.get_seam(block) != reduced.seam:
            self._add(f"block {block}: its seam differs from the reduced seams below", block)

    def _check_ids(self, tile: TileId, unknown: NDArray[np.uint32]) -> None:
        if len(unknown):
            self._add(f"{_name(tile)}: unregistered ids {unknown[:5].tolist()}", self._block_of(tile))

    def _is_done(self, tile: TileId) -> bool:
        job = self.jobs.get(block_of(tile, self.track.frame.zmax))
        return job is not None and job.state is State.DONE

    def _try(self, block: BlockId, check: Callable[[], None]) -> None:
        try:
            check()
        except (Map3dError, _core.CoreError) as error:
            self._add(f"block {block}: {error}", block)

    def _add(self, line: str, *blocks: BlockId) -> None:
        self.findings.add(f"{self.where} {line}", self.track.id, *blocks)

    def _block_of(self, tile: TileId) -> BlockId:
        return block_of(tile, self.track.frame.zmax)


def _name(tile: TileId) -> str:
    return f"{tile.z}/{tile.x}/{tile.y}"
