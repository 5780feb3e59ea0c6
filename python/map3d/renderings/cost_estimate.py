"""Estimates the cost of a rendering before any work: counts tiles from the plan, and derives bytes and time from recorded or sampled blocks."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

from map3d import _core
from map3d.catalogue import Catalogue, Job, PlannedJob, RenderingRecord, State, Track, Workspace
from map3d.errors import BadRequest
from map3d.renderings.plan import PlannedScene, plan_jobs, planned_occupancy, track_frame
from map3d.scenes.build import is_stale, open_scene
from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Occupancy, numbers_of
from map3d.types import BlockId

SAMPLE_BLOCKS: Final = 12
SAMPLE_S: Final = 10.0
RECORDED_BLOCKS: Final = 20
LEVELS_ABOVE: Final = 1.0 + 1 / 64 + 1 / 256 + 1 / 1024
"""Cost of all levels relative to the base blocks: a base block of four levels has 85 tiles, the next three levels together 21/64 of one block."""


@dataclass(frozen=True)
class TileCost:
    """The cost of one base tile of a pass, with its share of the levels above: encoded bytes of all layers, seconds on one core.

    `filled`: base tiles with content per planned base tile. `how`: the source of the values.
    """

    bytes_per_tile: float
    seconds_per_tile: float
    filled: float
    how: str


@dataclass(frozen=True)
class RenderingEstimate:
    """`base_tiles`: tiles of level zmax that may have content; `tiles`: tiles of all levels; `images`: tiles times layers; `bytes`: of the whole
    rendering. `open_tiles`: base tiles still to render, counted once per pass; `seconds`: to render them with `workers` workers."""

    base_tiles: int
    tiles: int
    images: int
    bytes: int
    open_tiles: int
    seconds: float
    workers: int
    how: str


@dataclass(frozen=True)
class _PassEstimate:
    """One pass of all views."""

    cost: TileCost
    base_tiles: float
    open_tiles: float


def estimate(workspace: Workspace, catalogue: Catalogue, name: str, workers: int, sample_s: float = SAMPLE_S) -> RenderingEstimate:
    """Plans the rendering without storing the plan; blocks whose content has changed since they were rendered count as open. `sample_s`: about how
    long it may render samples. Raises BadRequest when the build of the scene is out of date."""
    record = catalogue.rendering(name)
    if is_stale(workspace, catalogue, record.scene):
        raise BadRequest(f"scene {record.scene} has changed since its last build; map3d render {name} builds it first")
    scene = open_scene(workspace, record.scene, 256 << 20)
    jobs = {(job.track, job.block): job for job in catalogue.jobs(name)}
    return _estimate(scene, record, jobs, workers, sample_s)


def estimate_new(scene: _core.Scene, record: RenderingRecord, workers: int, sample_s: float) -> dict[str, Any]:
    """Returns the fields of the estimate of a rendering that has no jobs yet. `sample_s`: about how long it may render samples."""
    return asdict(_estimate(scene, record, {}, workers, sample_s))


def _estimate(
    scene: _core.Scene, record: RenderingRecord, jobs: Mapping[tuple[str, BlockId], Job], workers: int, sample_s: float
) -> RenderingEstimate:
    plans = {frame.id: planned_occupancy(scene, frame) for frame in record.frames}
    remaining = open_blocks(scene, record, jobs)
    passes = [_estimate_pass(scene, tracks, plans, jobs, remaining, sample_s) for tracks in zip(*map(record.tracks_of, record.frames), strict=True)]
    base, planned = passes[0].base_tiles, sum(plan.count(record.zmax) for plan in plans.values())
    tiles = sum(plan.count() for plan in plans.values()) * base / planned if planned else 0.0
    return RenderingEstimate(
        base_tiles=round(base),
        tiles=round(tiles),
        images=round(tiles) * len(record.layers),
        bytes=round(sum(one.base_tiles * one.cost.bytes_per_tile for one in passes)),
        open_tiles=round(sum(one.open_tiles for one in passes)),
        seconds=sum(one.open_tiles * one.cost.seconds_per_tile for one in passes) / workers,
        workers=workers,
        how="; ".join(dict.fromkeys(one.cost.how for one in passes)),
    )


def open_blocks(scene: PlannedScene, record: RenderingRecord, jobs: Mapping[tuple[str, BlockId], Job]) -> list[PlannedJob]:
    """Returns the base blocks that `map3d render` would render now: new, changed and unfinished ones. `jobs`: by track and block."""
    places: dict[str, list[tuple[int, int]]] = {}
    for (track, block), job in jobs.items():
        if job.kind == "base":
            places.setdefault(track, []).append((block.x, block.y))
    keys = {place: job.key for place, job in jobs.items() if job.state is State.DONE}
    planned = plan_jobs(scene, record, {track: numbers_of(own) for track, own in places.items()})
    return [job for job in planned if job.kind == "base" and keys.get((job.track, job.block)) != job.key]


def _estimate_pass(
    scene: _core.Scene,
    tracks: Sequence[Track],
    plans: Mapping[str, Occupancy],
    jobs: Mapping[tuple[str, BlockId], Job],
    remaining: Sequence[PlannedJob],
    sample_s: float,
) -> _PassEstimate:
    ids = {track.id for track in tracks}
    own_jobs = {place: job for place, job in jobs.items() if place[0] in ids}
    track_plans = {track.id: plans[track.frame.id] for track in tracks}
    cost = _recorded_cost(list(own_jobs.values()), track_plans) or _sampled_cost(scene, tracks, track_plans, sample_s)
    tiles = _base_tiles(track_plans, own_jobs, cost)
    # A conservatively planned block may have no planned base tile.
    return _PassEstimate(cost, sum(tiles.values()), sum(tiles.get((job.track, job.block), 0.0) for job in remaining if job.track in ids))


def _base_tiles(plans: Mapping[str, Occupancy], jobs: Mapping[tuple[str, BlockId], Job], cost: TileCost) -> dict[tuple[str, BlockId], float]:
    """Returns the number of base tiles with content of every base block: counted when it was rendered, else expected from the plan of its track."""
    expected = {
        (track, block): plan.count_in(block) * cost.filled
        for track, plan in plans.items()
        for block in (BlockId(*tile) for tile in plan.tiles(block_levels(plan.zmax)[0].root))
    }
    counted = {place: float(job.result.base_tiles) for place, job in jobs.items() if place in expected and job.result is not None}
    return {**{place: 0.0 for place, job in jobs.items() if job.kind == "base"}, **expected, **counted}


def _recorded_cost(jobs: Sequence[Job], plans: Mapping[str, Occupancy]) -> TileCost | None:
    """Returns the cost of the blocks that are done, None when they are too few. `plans`: by track."""
    done = [job for job in jobs if job.state is State.DONE and job.result is not None]
    base = [job for job in done if job.kind == "base" and job.result is not None and not job.result.empty]
    if not base or (len(base) < RECORDED_BLOCKS and len(done) < len(jobs)):
        return None
    results = [job.result for job in done if job.result is not None]
    tiles = sum(result.base_tiles for result in results)
    planned = sum(plans[job.track].count_in(job.block) for job in done if job.kind == "base")
    how = f"{len(base)} rendered blocks of this rendering"
    return TileCost(sum(result.bytes for result in results) / tiles, sum(result.seconds for result in results) / tiles, tiles / max(planned, 1), how)


def _sampled_cost(scene: _core.Scene, tracks: Sequence[Track], plans: Mapping[str, Occupancy], sample_s: float) -> TileCost:
    """Renders and discards a few blocks, spread over all tracks, and returns their cost."""
    zmax = tracks[0].frame.zmax
    blocks = [(track, BlockId(*tile)) for track in tracks for tile in plans[track.id].tiles(block_levels(zmax)[0].root)]
    size, tiles, planned, count = 0, 0, 0, 0
    started = time.perf_counter()
    for track, block in _spread(blocks):
        rendered = scene.render_block(track_frame(track), *block)
        size += sum(len(tile[4]) for tile in rendered.tiles)
        tiles += sum(tile[0] == 0 and tile[1] == zmax for tile in rendered.tiles)
        planned += plans[track.id].count_in(block)
        count += 1
        if time.perf_counter() - started > sample_s:
            break
    seconds = time.perf_counter() - started
    if not tiles:
        return TileCost(0.0, 0.0, 0.0, f"a sample of {count} blocks, all empty")
    return TileCost(
        size / tiles * LEVELS_ABOVE,
        seconds / tiles * LEVELS_ABOVE,
        tiles / planned,
        f"a sample of {count} blocks ({tiles} tiles), rendered on one core",
    )


def _spread(blocks: Sequence[tuple[Track, BlockId]]) -> list[tuple[Track, BlockId]]:
    """Returns evenly spaced entries of the list, always the same ones."""
    count = min(len(blocks), SAMPLE_BLOCKS)
    return [blocks[(2 * k + 1) * len(blocks) // (2 * count)] for k in range(count)]
