"""Laws of sweep, cancel, retry and reopen, and of a kill between the two steps of `done`."""

import pytest

from map3d.catalogue import Catalogue, State
from map3d.errors import NotFound, StaleFence
from map3d.messages import verbatim
from map3d.types import BlockId
from tests.catalogue.pyramids import RESULT, TRACKS, is_bottom_up, pyramid, states, take, work_off

TRACK = TRACKS[0]
TOP, FIRST, SECOND = BlockId(0, 0, 0), BlockId(3, 0, 0), BlockId(3, 1, 0)
BASE = [BlockId(6, 4 * n, 0) for n in range(4)]
JOBS = 7


@pytest.fixture
def planned(catalogue: Catalogue) -> Catalogue:
    catalogue.plan("town-a", pyramid(tracks=[TRACK]))
    return catalogue


@pytest.fixture
def done(planned: Catalogue) -> Catalogue:
    assert len(work_off(planned)) == JOBS
    return planned


@pytest.mark.parametrize("number", range(JOBS))
def test_sweep_completes_a_done_that_was_killed_between_its_steps(planned: Catalogue, number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def killed(*_: object) -> None:
        raise RuntimeError("killed")

    for _ in range(number):
        planned.done(take(planned), RESULT)
    lease = take(planned)
    with monkeypatch.context() as patched:
        patched.setattr(type(planned), "_open_above", killed)
        with pytest.raises(RuntimeError, match="killed"):
            planned.done(lease, RESULT)
    planned.expire("town-a", ["w"])
    blocks = work_off(planned)
    assert set(blocks) <= {job.block for job in pyramid(tracks=[TRACK])}
    assert is_bottom_up(blocks)
    assert planned.count_jobs("town-a")[State.DONE] == JOBS


def test_sweep_opens_nothing_above_unfinished_jobs(planned: Catalogue) -> None:
    assert planned.sweep("town-a") == 0
    planned.done(take(planned), RESULT)
    take(planned)
    assert planned.sweep("town-a") == 0
    assert states(planned, State.WAITING) == [TOP, FIRST, SECOND]


def test_rendering_has_open_jobs_until_the_last_is_done(planned: Catalogue) -> None:
    while planned.has_open_jobs("town-a"):
        lease = take(planned)
        assert planned.has_open_jobs("town-a")
        planned.done(lease, RESULT)
    assert planned.count_jobs("town-a")[State.DONE] == JOBS


def test_waiting_and_quarantined_jobs_are_not_open(planned: Catalogue) -> None:
    while (lease := planned.lease("town-a", "w")) is not None:
        planned.fail(lease, verbatim("bad"))
    assert not planned.has_open_jobs("town-a")
    assert not planned.has_open_jobs("nowhere")


def test_cancel_stops_all_open_jobs(planned: Catalogue) -> None:
    planned.done(take(planned), RESULT)
    lease = take(planned)
    assert planned.cancel("town-a") == JOBS - 1
    for call in (planned.heartbeat, planned.release, lambda held: planned.done(held, RESULT)):
        with pytest.raises(StaleFence):
            call(lease)
    assert planned.lease("town-a", "w") is None
    assert (states(planned, State.DONE), planned.sweep("town-a"), planned.cancel("town-a")) == ([BASE[0]], 0, 0)


@pytest.mark.parametrize("way", ["plan", "retry"])
def test_cancelled_jobs_are_reopened_by_plan_and_retry(planned: Catalogue, way: str) -> None:
    planned.done(take(planned), RESULT)
    stale = take(planned)
    planned.cancel("town-a")
    if way == "plan":
        counts = planned.plan("town-a", pyramid(tracks=[TRACK]))
        assert (counts.added, counts.changed, counts.kept) == (0, JOBS - 1, 1)
    else:
        assert planned.retry("town-a") == JOBS - 1
    assert states(planned, State.TODO) == BASE[1:]
    assert states(planned, State.WAITING) == [TOP, FIRST, SECOND]
    fresh = take(planned)
    assert (fresh.block, fresh.attempt) == (stale.block, 1)
    assert fresh.fence > stale.fence
    planned.done(fresh, RESULT)
    assert len(work_off(planned)) == JOBS - 2


def test_only_the_named_jobs_are_cancelled(planned: Catalogue) -> None:
    assert planned.cancel("town-a", [(TRACK, BASE[1]), (TRACK, SECOND), ("no-track", BASE[0])]) == 2
    assert work_off(planned) == [BASE[0], BASE[2], BASE[3]]
    assert planned.retry("town-a", [(TRACK, SECOND)]) == 1
    assert work_off(planned) == [SECOND]
    assert states(planned, State.WAITING) == [TOP, FIRST]
    assert planned.retry("town-a") == 1
    assert work_off(planned) == [BASE[1], FIRST, TOP]


def test_reopened_job_and_all_above_are_done_again(done: Catalogue) -> None:
    assert done.reopen("town-a", [(TRACK, BASE[2])]) == 3
    assert states(done, State.TODO) == [BASE[2]]
    assert work_off(done) == [BASE[2], SECOND, TOP]
    assert done.reopen("town-a", [(TRACK, FIRST), (TRACK, BASE[3])]) == 4
    assert sorted(states(done, State.TODO)) == [FIRST, BASE[3]], "the blocks below the first are done"
    assert sorted(work_off(done)) == sorted([FIRST, BASE[3], SECOND, TOP])


def test_reopened_jobs_keep_their_result_and_raise_the_version(done: Catalogue) -> None:
    done.announce("town-a", 1)
    done.reopen("town-a", [(TRACK, TOP)])
    (job,) = done.jobs("town-a", state=State.TODO)
    assert (job.block, job.result, job.attempts, job.reason) == (TOP, RESULT, 0, None)
    assert take(done).content_version == 2


def test_only_done_jobs_are_reopened(planned: Catalogue) -> None:
    lease = take(planned)
    assert planned.reopen("town-a", [(TRACK, BASE[0]), (TRACK, BASE[1]), (TRACK, TOP), (TRACK, BlockId(6, 63, 63))]) == 0
    planned.done(lease, RESULT)
    planned.announce("town-a", 1)
    assert planned.reopen("town-a", []) == 0
    assert planned.rendering("town-a").content_version == 1


def test_reopening_makes_the_lease_above_stale(planned: Catalogue) -> None:
    while (above := take(planned)).block != FIRST:
        planned.done(above, RESULT)
    assert planned.reopen("town-a", [(TRACK, BASE[0])]) == 2
    with pytest.raises(StaleFence):
        planned.done(above, RESULT)
    assert FIRST not in states(planned, State.TODO)
    assert work_off(planned)[-1] == TOP


def test_retry_leaves_a_reduce_job_waiting_above_open_jobs(planned: Catalogue) -> None:
    while (lease := planned.lease("town-a", "w")) is not None:
        planned.done(lease, RESULT) if lease.kind == "base" else planned.fail(lease, verbatim("bad"))
    assert states(planned, State.QUARANTINED) == [FIRST, SECOND]
    planned.reopen("town-a", [(TRACK, BASE[0])])
    assert planned.retry("town-a") == 2
    assert states(planned, State.TODO) == [SECOND, BASE[0]]
    assert is_bottom_up(work_off(planned))
    assert planned.count_jobs("town-a")[State.DONE] == JOBS


@pytest.mark.parametrize("word", ["retry", "cancel"])
def test_unknown_rendering_is_refused(catalogue: Catalogue, word: str) -> None:
    with pytest.raises(NotFound, match="nowhere"):
        getattr(catalogue, word)("nowhere")
    with pytest.raises(NotFound, match="nowhere"):
        catalogue.reopen("nowhere", [])
