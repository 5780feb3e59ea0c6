"""Which blocks are planned, and what their keys depend on."""

from dataclasses import replace

import pytest

from map3d.errors import OutsideFrame
from map3d.renderings.plan import plan_jobs
from map3d.tiles.naming import block_above, block_levels
from map3d.types import BlockId, Layer, ViewAngles
from tests.renderings.scenes import SquareScene, rendering

CONTENT = {(0.1, 0.1): "a", (0.9, 0.9): "b"}


def test_only_blocks_with_content_are_planned_in_every_view() -> None:
    record = rendering()
    jobs = plan_jobs(SquareScene(CONTENT), record, {})
    root = block_levels(record.zmax)[0].root
    base = [(job.track, job.block) for job in jobs if job.kind == "base"]
    side = 2**root
    corners = [BlockId(root, int(0.1 * side), int(0.1 * side)), BlockId(root, int(0.9 * side), int(0.9 * side))]
    assert base == [(frame.id, block) for frame in record.frames for block in corners]


def test_every_planned_block_has_the_one_above_planned_up_to_the_top() -> None:
    record = rendering()
    jobs = plan_jobs(SquareScene(CONTENT), record, {})
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
    after = {job.block: job.key for job in plan_jobs(SquareScene({(0.1, 0.1): "a"}), record, {record.frames[0].id: known})}
    assert before.keys() == after.keys()
    assert before[known[1]] != after[known[1]]
    assert before[known[0]] == after[known[0]]


def test_planning_again_gives_the_same_plan() -> None:
    record = rendering()
    assert plan_jobs(SquareScene(CONTENT), record, {}) == plan_jobs(SquareScene(dict(reversed(CONTENT.items()))), record, {})


def test_an_empty_scene_needs_no_blocks() -> None:
    assert plan_jobs(SquareScene({}), rendering(), {}) == []


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
    plan_jobs(SquareScene(CONTENT), rendering(), {}, lambda done, total: seen.append((done, total)))
    assert seen == [(0, 2), (1, 2)]
