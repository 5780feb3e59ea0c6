"""Renders base blocks again and compares them with the stored ones, byte by byte: `map3d verify --sample` and `--deep`."""

import random
from collections.abc import Callable

from map3d import _core
from map3d.catalogue import Catalogue, RenderingRecord, State, Track, Workspace
from map3d.renderings.plan import track_frame
from map3d.renderings.render_task import CACHE_BYTES
from map3d.scenes.build import is_stale, open_scene
from map3d.scenes.scene_cache import scene_in_use
from map3d.tiles.naming import tiles_of_block
from map3d.tiles.tile_store import TileStore
from map3d.tiles.track_stores import open_track
from map3d.types import BlockId
from map3d.verify.findings import Findings

Progress = Callable[[str, int, int], None]


def verify_pixels(
    workspace: Workspace, catalogue: Catalogue, name: str, findings: Findings, progress: Progress, *, sample: int | None, seed: int
) -> None:
    """Renders `sample` of the done base blocks again, chosen by `seed`; None renders all of them. A scene that has to be built again is skipped."""
    record = catalogue.rendering(name)
    if is_stale(workspace, catalogue, record.scene):
        return
    with scene_in_use(workspace, catalogue.scene(record.scene)):
        _verify_blocks(workspace, catalogue, record, findings, progress, sample, seed)


def _verify_blocks(
    workspace: Workspace, catalogue: Catalogue, record: RenderingRecord, findings: Findings, progress: Progress, sample: int | None, seed: int
) -> None:
    name, scene = record.name, open_scene(workspace, record.scene, CACHE_BYTES)
    chosen = _done_blocks(catalogue, record)
    if sample is not None and sample < len(chosen):
        chosen = random.Random(seed).sample(chosen, sample)
    for done, (track, block) in enumerate(chosen, 1):
        with open_track(workspace, record, track.id) as store:
            different = _count_differences(scene, store, track, block)
        if different:
            findings.add(f"{name} {track.id} block {block}: {different} images or seams differ from those of a new render", track.id, block)
        findings.count("blocks rendered again")
        progress(f"rendering blocks of {name} again", done, len(chosen))


def _done_blocks(catalogue: Catalogue, record: RenderingRecord) -> list[tuple[Track, BlockId]]:
    return [(track, job.block) for track in record.tracks for job in catalogue.jobs(record.name, track.id, State.DONE) if job.kind == "base"]


def _count_differences(scene: _core.Scene, store: TileStore, track: Track, block: BlockId) -> int:
    rendered = scene.render_block(track_frame(track), *block)
    tiles = {(layer, z, x, y): data for layer, z, x, y, data in rendered.tiles}
    names = [(layer, *tile) for tile in tiles_of_block(block, track.frame.zmax) for layer in range(len(track.layers))]
    return sum(store.get_tile(*name) != tiles.get(name) for name in names) + (store.get_seam(block) != rendered.seam)
