"""What a rendering will take, before any work: tiles counted from the plan, bytes and time from what is known of its tiles."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from map3d import _core
from map3d.catalogue import Catalogue, Job, PlannedJob, RenderingRecord, State, Track, Workspace
from map3d.errors import BadRequest
from map3d.renderings.build import is_stale, open_scene
from map3d.renderings.plan import PlannedScene, frame_text, plan_jobs, planned_occupancy
from map3d.tiles.naming import block_levels, morton
from map3d.tiles.occupancy import Occupancy
from map3d.types import BlockId

SAMPLE_BLOCKS: Final = 12
SAMPLE_S: Final = 10.0
RECORDED_BLOCKS: Final = 20
LEVELS_ABOVE: Final = 1.0 + 1 / 64 + 1 / 256 + 1 / 1024
"""What the levels above the base blocks add to their tiles: a base block of four levels has 85 tiles, the next three levels up 21/64 of one block."""


@dataclass(frozen=True)
class Rate:
    """Of one base tile of a pass with its share of the levels above: encoded bytes of all its layers, seconds of one core. `how` says where they are
    from."""

    bytes_a_tile: float
    seconds_a_tile: float
    filled: float
    """Base tiles with content for one that may have it."""
    how: str


@dataclass(frozen=True)
class Estimate:
    """`base_tiles`: at level zmax, that may have content; `tiles`: of all levels; `images`: those times the layers. Of the whole rendering; `seconds`
    and `open_tiles` (one that several passes want counts for each): of what is still to do, with `workers` workers."""

    base_tiles: int
    tiles: int
    images: int
    bytes: int
    open_tiles: int
    seconds: float
    workers: int
    how: str


def estimate(workspace: Workspace, catalogue: Catalogue, name: str, workers: int) -> Estimate:
    """Plans in earnest, without keeping the plan: blocks whose content changed since they were rendered count as open. Raises BadRequest when the
    scene is not built as it is now."""
    record = catalogue.rendering(name)
    if is_stale(workspace, catalogue, record.scene):
        raise BadRequest(f"scene {record.scene} has changed since it was built; map3d render {name} builds it first")
    scene = open_scene(workspace, record.scene, 256 << 20)
    plans = {frame.id: planned_occupancy(scene, record, frame) for frame in record.frames}
    known = {(job.track, job.block): job for job in catalogue.jobs(name)}
    to_do = open_blocks(scene, record, known)
    parts = [_of_pass(scene, tracks, plans, known, to_do) for tracks in zip(*map(record.tracks_of, record.frames), strict=True)]
    base, planned = parts[0].base_tiles, sum(plan.count(record.zmax) for plan in plans.values())
    tiles = sum(plan.count() for plan in plans.values()) * base / planned if planned else 0.0
    return Estimate(
        base_tiles=round(base),
        tiles=round(tiles),
        images=round(tiles) * len(record.layers),
        bytes=round(sum(part.base_tiles * part.rate.bytes_a_tile for part in parts)),
        open_tiles=round(sum(part.open_tiles for part in parts)),
        seconds=sum(part.open_tiles * part.rate.seconds_a_tile for part in parts) / workers,
        workers=workers,
        how="; ".join(dict.fromkeys(part.rate.how for part in parts)),
    )


@dataclass(frozen=True)
class _Part:
    """Of one pass, all views together."""

    rate: Rate
    base_tiles: float
    open_tiles: float


def _of_pass(
    scene: _core.Scene, tracks: Sequence[Track], plans: Mapping[str, Occupancy], known: Mapping[tuple[str, BlockId], Job], to_do: Sequence[PlannedJob]
) -> _Part:
    ids = {track.id for track in tracks}
    jobs = {place: job for place, job in known.items() if place[0] in ids}
    within = {track.id: plans[track.frame.id] for track in tracks}
    rate = _recorded(list(jobs.values()), within) or _sampled(scene, tracks, within)
    tiles_of = _tiles(within, jobs, rate)
    return _Part(rate, sum(tiles_of.values()), sum(tiles_of[job.track, job.block] for job in to_do if job.track in ids))


def open_blocks(scene: PlannedScene, record: RenderingRecord, known: Mapping[tuple[str, BlockId], Job]) -> list[PlannedJob]:
    """Base blocks that `map3d render` would render now: new ones, changed ones, and those that are not done."""
    blocks: dict[str, list[BlockId]] = {}
    for (track, block), job in known.items():
        if job.kind == "base":
            blocks.setdefault(track, []).append(block)
    planned = [job for job in plan_jobs(scene, record, blocks) if job.kind == "base"]
    stands = {place: job.key for place, job in known.items() if job.state is State.DONE}
    return [job for job in planned if stands.get((job.track, job.block)) != job.key]


def _tiles(plans: Mapping[str, Occupancy], known: Mapping[tuple[str, BlockId], Job], rate: Rate) -> dict[tuple[str, BlockId], float]:
    """Base tiles with content of every base block: as counted when it was rendered, else what the plan of its track lets expect."""
    found = {
        (track, block): _tiles_within(plan, block) * rate.filled
        for track, plan in plans.items()
        for block in (BlockId(*tile) for tile in plan.tiles(block_levels(plan.zmax)[0].root))
    }
    counted = {place: float(job.result.base_tiles) for place, job in known.items() if place in found and job.result is not None}
    return {**{place: 0.0 for place, job in known.items() if job.kind == "base"}, **found, **counted}


def _recorded(jobs: Sequence[Job], plans: Mapping[str, Occupancy]) -> Rate | None:
    """From the blocks that are done, if they are many enough, or all. `plans`: of each track."""
    done = [job for job in jobs if job.state is State.DONE and job.result is not None]
    base = [job for job in done if job.kind == "base" and job.result is not None and not job.result.empty]
    if not base or (len(base) < RECORDED_BLOCKS and len(done) < len(jobs)):
        return None
    results = [job.result for job in done if job.result is not None]
    tiles = sum(result.base_tiles for result in results)
    planned = sum(_tiles_within(plans[job.track], job.block) for job in done if job.kind == "base")
    how = f"rates recorded from {len(base)} blocks of this rendering"
    return Rate(sum(result.bytes for result in results) / tiles, sum(result.seconds for result in results) / tiles, tiles / max(planned, 1), how)


def _sampled(scene: _core.Scene, tracks: Sequence[Track], plans: Mapping[str, Occupancy]) -> Rate:
    """From a few blocks spread over all tracks, rendered now and thrown away."""
    zmax = tracks[0].frame.zmax
    blocks = [(track, BlockId(*tile)) for track in tracks for tile in plans[track.id].tiles(block_levels(zmax)[0].root)]
    size, tiles, planned, count = 0, 0, 0, 0
    begun = time.perf_counter()
    for track, block in _spread(blocks):
        rendered = scene.render_block(frame_text(track), *block)
        size += sum(len(tile[4]) for tile in rendered.tiles)
        tiles += sum(tile[0] == 0 and tile[1] == zmax for tile in rendered.tiles)
        planned += _tiles_within(plans[track.id], block)
        count += 1
        if time.perf_counter() - begun > SAMPLE_S:
            break
    seconds = time.perf_counter() - begun
    if not tiles:
        return Rate(0.0, 0.0, 0.0, f"a sample of {count} blocks, all empty")
    return Rate(
        size / tiles * LEVELS_ABOVE,
        seconds / tiles * LEVELS_ABOVE,
        tiles / planned,
        f"a sample of {count} blocks ({tiles} tiles) rendered just now on one core",
    )


def _spread(blocks: Sequence[tuple[Track, BlockId]]) -> list[tuple[Track, BlockId]]:
    """Evenly over the list, always the same ones."""
    count = min(len(blocks), SAMPLE_BLOCKS)
    return [blocks[(2 * k + 1) * len(blocks) // (2 * count)] for k in range(count)]


def _tiles_within(plan: Occupancy, block: BlockId) -> int:
    """Base tiles of the plan that lie in a base block."""
    levels = plan.zmax - block_levels(plan.zmax)[0].root
    first = morton(block.x, block.y) << 2 * levels
    numbers = plan.numbers(plan.zmax)
    low, high = np.searchsorted(numbers, np.array([first, first + (1 << 2 * levels)], dtype=np.uint64))
    return int(high - low)
