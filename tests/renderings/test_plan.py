"""Which blocks are planned, and what their keys depend on."""

import hashlib
import json
import tracemalloc
from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from map3d.catalogue import PlannedJob, RenderingRecord, Track
from map3d.errors import OutsideFrame
from map3d.renderings import plan
from map3d.renderings.plan import plan_jobs, settings_hash, track_frame
from map3d.tiles.naming import block_above, block_level, block_levels, from_morton, morton
from map3d.tiles.occupancy import numbers_of
from map3d.types import BlockId, Layer, ViewAngles
from tests.renderings.scenes import SparseScene, SquareScene, rendering

CONTENT = {(0.1, 0.1): "a", (0.9, 0.9): "b"}


def test_only_blocks_with_content_are_planned_in_every_view() -> None:
    record = rendering()
    jobs = list(plan_jobs(SquareScene(CONTENT), record, {}))
    root = block_levels(record.zmax)[0].root
    base = [(job.track, job.block) for job in jobs if job.kind == "base"]
    side = 2**root
    corners = [BlockId(root, int(0.1 * side), int(0.1 * side)), BlockId(root, int(0.9 * side), int(0.9 * side))]
    assert base == [(frame.id, block) for frame in record.frames for block in corners]


def test_every_planned_block_has_the_one_above_planned_up_to_the_top() -> None:
    record = rendering()
    jobs = list(plan_jobs(SquareScene(CONTENT), record, {}))
    have = {(job.track, job.block) for job in jobs}
    for job in jobs:
        assert job.parent == block_above(job.block, record.zmax)
        assert job.parent is None or (job.track, job.parent) in have
    assert {(frame.id, BlockId(0, 0, 0)) for frame in record.frames} <= have
    assert len(have) == len(jobs)


def test_a_change_changes_the_keys_of_its_block_and_of_those_above() -> None:
    record = rendering(views=(ViewAngles(0, 45),))
    before = {job.block: job.key for job in plan_jobs(SquareScene(CONTENT), record, {})}
    after = {job.block: job.key for job in plan_jobs(SquareScene({**CONTENT, (0.9, 0.9): "changed"}), record, {})}
    changed = {block for block in before if before[block] != after[block]}
    root = block_levels(record.zmax)[0].root
    expected, block = set(), BlockId(root, int(0.9 * 2**root), int(0.9 * 2**root))
    while block is not None:
        expected.add(block)
        block = block_above(block, record.zmax)
    assert before.keys() == after.keys()
    assert changed == expected


def test_a_block_that_lost_its_content_stays_planned_with_another_key() -> None:
    record = rendering(views=(ViewAngles(0, 45),))
    before = {job.block: job.key for job in plan_jobs(SquareScene(CONTENT), record, {})}
    known = [block for block in before if block.z == block_levels(record.zmax)[0].root]
    numbers = numbers_of((block.x, block.y) for block in known)
    after = {job.block: job.key for job in plan_jobs(SquareScene({(0.1, 0.1): "a"}), record, {record.frames[0].id: numbers})}
    assert before.keys() == after.keys()
    assert before[known[1]] != after[known[1]]
    assert before[known[0]] == after[known[0]]


def test_planning_again_gives_the_same_plan() -> None:
    record = rendering()
    assert list(plan_jobs(SquareScene(CONTENT), record, {})) == list(plan_jobs(SquareScene(dict(reversed(CONTENT.items()))), record, {}))


def test_an_empty_scene_needs_no_blocks() -> None:
    assert list(plan_jobs(SquareScene({}), rendering(), {})) == []


def test_a_pyramid_of_one_block_has_no_reduce_job() -> None:
    record = rendering(res_m=1.0, views=(ViewAngles(0, 45),))
    assert record.zmax <= 3
    assert [(job.block, job.kind, job.parent) for job in plan_jobs(SquareScene(CONTENT), record, {})] == [(BlockId(0, 0, 0), "base", None)]


def test_every_pass_of_a_view_has_the_same_blocks_with_keys_of_its_own() -> None:
    record = rendering()
    wider = replace(record, passes=(*record.passes, (Layer("normal", "normal", "png"),), (Layer("depth", "depth", "png"),)))
    before = {(job.track, job.block): job.key for job in plan_jobs(SquareScene(CONTENT), record, {})}
    after = {(job.track, job.block): job.key for job in plan_jobs(SquareScene(CONTENT), wider, {})}
    assert {place: after[place] for place in before} == before
    for frame in record.frames:
        blocks = [{block for track, block in after if track == one.id} for one in wider.tracks_of(frame)]
        assert blocks[0] == blocks[1] == blocks[2]
        for block in blocks[0]:
            assert len({after[one.id, block] for one in wider.tracks_of(frame)}) == 3


def test_content_that_left_the_frame_is_refused_naming_regrid() -> None:
    far = SquareScene(CONTENT, box=((0.0, 0.0, 0.0), (900.0, 100.0, 10.0)))
    with pytest.raises(OutsideFrame, match="--regrid"):
        plan_jobs(far, rendering(), {})


def test_progress_counts_every_view() -> None:
    seen: list[tuple[int, int]] = []
    list(plan_jobs(SquareScene(CONTENT), rendering(), {}, lambda done, total: seen.append((done, total))))
    assert seen == [(0, 2), (1, 2)]


def plan_by_levels(scene: SquareScene, record: RenderingRecord, known: Mapping[str, Collection[BlockId]]) -> list[PlannedJob]:
    """Plans level by level, with all blocks in memory: the oracle for the streaming plan."""
    jobs: list[PlannedJob] = []
    for frame in record.frames:
        root = block_levels(frame.zmax)[0].root
        occupied = {BlockId(root, *from_morton(int(number))) for number in scene.occupied(track_frame(Track(frame, 0, ())), root)}
        for track in record.tracks_of(frame):
            blocks = list(occupied | set(known.get(track.id, ())))
            jobs += reduce_levels(track, dict(zip(blocks, scene.block_keys(track_frame(track), root, np.array(blocks)[:, 1:]), strict=True)))
    return jobs


def reduce_levels(track: Track, base: Mapping[BlockId, str]) -> list[PlannedJob]:
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


shares = st.floats(0, 1, exclude_max=True)
places = st.tuples(shares, shares)


@given(content=st.sets(places, min_size=1, max_size=40), earlier=st.sets(places, max_size=10), res_m=st.sampled_from([0.2, 0.02, 0.001]))
def test_streaming_plans_the_same_jobs_as_planning_level_by_level(
    content: set[tuple[float, float]], earlier: set[tuple[float, float]], res_m: float
) -> None:
    record = rendering(res_m)
    root = block_levels(record.zmax)[0].root
    scene = SquareScene({place: str(place) for place in content})
    known = [BlockId(root, int(u * 2**root), int(v * 2**root)) for u, v in earlier]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plan, "KEY_BATCH", 3)
        jobs = list(plan_jobs(scene, record, {record.tracks[0].id: numbers_of((block.x, block.y) for block in known)}))
    expected = plan_by_levels(scene, record, {record.tracks[0].id: known})
    assert len(jobs) == len(expected)
    assert {replace(job, ground=0) for job in jobs} == set(expected)
    position = {(job.track, job.block): index for index, job in enumerate(jobs)}
    assert all(job.parent is None or position[job.track, job.parent] > position[job.track, job.block] for job in jobs)
    for track in record.tracks:
        base = [job.order for job in jobs if job.track == track.id and job.kind == "base"]
        assert base == sorted(base)
    below: dict[tuple[str, BlockId], list[PlannedJob]] = {}
    for job in jobs:
        if job.parent is not None:
            below.setdefault((job.track, job.parent), []).append(job)
    assert all(job.ground == below[job.track, job.block][0].ground for job in jobs if job.kind == "reduce")


def test_memory_of_planning_does_not_grow_with_the_number_of_jobs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plan, "KEY_BATCH", 256)
    record = rendering(0.0001, (ViewAngles(0, 45),))
    peaks = []
    for side in (32, 128):
        scene = SparseScene(side, step=3)
        tracemalloc.start()
        assert sum(job.kind == "base" for job in plan_jobs(scene, record, {})) == side**2
        peaks.append(tracemalloc.get_traced_memory()[1] - 8 * side**2)
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0] + (100 << 10), "16 times as many blocks"


def test_content_outside_the_frame_is_refused_before_the_first_job() -> None:
    far = SquareScene(CONTENT, box=((0.0, 0.0, 0.0), (900.0, 100.0, 10.0)))
    with pytest.raises(OutsideFrame):
        plan_jobs(far, rendering(), {})  # not even the first job is asked for
