"""Laws of leasing one block out of turn, of evicting it, and of the queries of one block."""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from map3d.catalogue import Catalogue, State
from map3d.catalogue.states import MAX_ATTEMPTS
from map3d.errors import StaleFence
from map3d.messages import verbatim
from map3d.types import BlockId
from tests.catalogue.implementations import LEASE_S
from tests.catalogue.pyramids import RESULT, TRACKS, pyramid, take, work_off

TRACK = TRACKS[0]
TOP, FIRST, SECOND = BlockId(0, 0, 0), BlockId(3, 0, 0), BlockId(3, 1, 0)
BASE = [BlockId(6, 4 * n, 0) for n in range(4)]


@pytest.fixture
def planned(catalogue: Catalogue) -> Catalogue:
    catalogue.plan("town-a", pyramid())
    return catalogue


def state(catalogue: Catalogue, block: BlockId, track: str = TRACK) -> State:
    job = catalogue.job("town-a", track, block)
    assert job is not None
    return job.state


def do_block(catalogue: Catalogue, block: BlockId) -> None:
    lease = catalogue.lease_block("town-a", "w", TRACK, block)
    assert lease is not None
    catalogue.done(lease, RESULT)


def test_a_block_is_leased_out_of_turn(planned: Catalogue) -> None:
    lease = planned.lease_block("town-a", "w", TRACKS[1], BASE[3])
    assert lease is not None
    assert (lease.track, lease.block, lease.kind, lease.attempt, lease.worker) == (TRACKS[1], BASE[3], "base", 1, "w")
    assert lease.content_version == planned.rendering("town-a").content_version
    planned.heartbeat(lease)
    planned.done(lease, RESULT)
    assert state(planned, BASE[3], TRACKS[1]) is State.DONE
    assert take(planned).block == BASE[0]


@pytest.mark.parametrize("block", [FIRST, TOP, BlockId(6, 1, 1)], ids=["waiting", "waiting above", "not planned"])
def test_only_a_todo_job_is_leased(planned: Catalogue, block: BlockId) -> None:
    assert planned.lease_block("town-a", "w", TRACK, block) is None


def test_of_many_callers_one_gets_the_block(planned: Catalogue) -> None:
    with ThreadPoolExecutor(16) as threads:
        leases = list(threads.map(lambda n: planned.lease_block("town-a", f"w{n}", TRACK, BASE[2]), range(16)))
    assert sum(lease is not None for lease in leases) == 1


def test_the_overdue_lease_of_a_block_expires_first(brief_catalogue: Catalogue) -> None:
    brief_catalogue.plan("town-a", pyramid())
    first = brief_catalogue.lease_block("town-a", "killed", TRACK, BASE[0])
    assert first is not None
    deadline_s = time.monotonic() + 20 * LEASE_S
    while (second := brief_catalogue.lease_block("town-a", "w", TRACK, BASE[0])) is None:
        assert time.monotonic() < deadline_s
        time.sleep(LEASE_S / 10)
    assert (second.attempt, second.fence) == (1, first.fence + 1)
    with pytest.raises(StaleFence):
        brief_catalogue.done(first, RESULT)


def test_an_evicted_block_is_leased_and_then_open(planned: Catalogue) -> None:
    do_block(planned, BASE[0])
    before = planned.job("town-a", TRACK, BASE[0])
    lease = planned.evict("town-a", "remover", TRACK, BASE[0])
    assert lease is not None
    assert before is not None
    assert lease.fence == before.fence + 1
    assert state(planned, BASE[0]) is State.LEASED
    assert planned.lease_block("town-a", "w", TRACK, BASE[0]) is None
    assert planned.evict("town-a", "other", TRACK, BASE[0]) is None
    planned.heartbeat(lease)
    planned.release(lease)
    after = planned.job("town-a", TRACK, BASE[0])
    assert after is not None
    assert (after.state, after.attempts, after.result, after.key) == (State.TODO, 0, before.result, before.key)


def test_eviction_does_not_use_up_attempts(planned: Catalogue) -> None:
    for _ in range(MAX_ATTEMPTS + 1):
        do_block(planned, BASE[0])
        lease = planned.evict("town-a", "remover", TRACK, BASE[0])
        assert lease is not None
        planned.release(lease)
    again = planned.lease_block("town-a", "w", TRACK, BASE[0])
    assert again is not None
    assert (again.attempt, planned.fail(again, verbatim("once"))) == (1, State.TODO)


def test_an_eviction_that_was_killed_leaves_the_block_open(brief_catalogue: Catalogue) -> None:
    brief_catalogue.plan("town-a", pyramid())
    do_block(brief_catalogue, BASE[0])
    lease = brief_catalogue.evict("town-a", "killed", TRACK, BASE[0])
    assert lease is not None
    assert brief_catalogue.expire("town-a", ["killed"]) == 1
    assert state(brief_catalogue, BASE[0]) is State.TODO
    with pytest.raises(StaleFence):
        brief_catalogue.heartbeat(lease)


def test_a_complete_rendering_is_never_evicted(planned: Catalogue) -> None:
    work_off(planned)
    assert planned.evict("town-a", "w", TRACK, BASE[0]) is None
    planned.reopen("town-a", [(TRACK, BASE[1])])
    assert planned.evict("town-a", "w", TRACK, BASE[0]) is not None


@pytest.mark.parametrize("block", [BASE[1], FIRST, BlockId(6, 1, 1)], ids=["todo", "reduce", "not planned"])
def test_only_done_base_blocks_are_evicted(planned: Catalogue, block: BlockId) -> None:
    assert planned.evict("town-a", "w", TRACK, block) is None


@pytest.mark.parametrize("is_leased", [False, True], ids=["todo", "leased"])
def test_the_open_reduce_job_above_an_evicted_block_waits(planned: Catalogue, is_leased: bool) -> None:
    do_block(planned, BASE[0])
    do_block(planned, BASE[1])
    above = planned.lease_block("town-a", "w", TRACK, FIRST) if is_leased else None
    evicted = planned.evict("town-a", "remover", TRACK, BASE[0])
    assert evicted is not None
    assert state(planned, FIRST) is State.WAITING
    if above is not None:
        with pytest.raises(StaleFence):
            planned.heartbeat(above)
    assert planned.sweep("town-a") == 0
    planned.release(evicted)
    assert planned.sweep("town-a") == 0
    do_block(planned, BASE[0])
    assert state(planned, FIRST) is State.TODO


def test_the_done_reduce_job_above_an_evicted_block_stays_done(planned: Catalogue) -> None:
    for block in (BASE[0], BASE[1], FIRST):
        do_block(planned, block)
    assert planned.evict("town-a", "remover", TRACK, BASE[0]) is not None
    assert state(planned, FIRST) is State.DONE
    assert planned.evict("town-a", "remover", TRACK, FIRST) is None


def test_the_job_of_one_block_is_that_of_the_list(planned: Catalogue) -> None:
    take(planned)
    jobs = {(job.track, job.block): job for job in planned.jobs("town-a")}
    assert {place: planned.job("town-a", *place) for place in jobs} == jobs
    assert planned.job("town-a", TRACK, BlockId(6, 1, 1)) is None
    assert planned.job("none", TRACK, TOP) is None


def test_jobs_below_a_block(planned: Catalogue) -> None:
    def below(block: BlockId, track: str = TRACK) -> list[BlockId]:
        found = planned.jobs_below("town-a", track, block)
        assert {job.track for job in found} <= {track}
        return [job.block for job in found]

    assert below(TOP) == [FIRST, SECOND]
    assert below(SECOND, TRACKS[1]) == BASE[2:]
    assert below(BASE[0]) == []


def test_a_plan_between_eviction_and_release_wins(planned: Catalogue, open_at: Callable[..., Catalogue]) -> None:
    do_block(planned, BASE[0])
    lease = planned.evict("town-a", "remover", TRACK, BASE[0])
    assert lease is not None
    open_at().plan("town-a", pyramid("xbcd"))
    with pytest.raises(StaleFence):
        planned.release(lease)
    assert state(planned, BASE[0]) is State.TODO
