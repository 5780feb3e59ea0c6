"""Laws of planning: a plan streams, and after a kill at any point the same plan leads to the same jobs (spec/catalogue.md)."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest

from map3d.catalogue import Catalogue, PlanCounts, PlannedJob, State, mongodb_jobs, mongodb_plan, sqlite_jobs
from map3d.errors import NotFound, StaleFence
from map3d.messages import verbatim
from map3d.types import BlockId
from tests.catalogue.pyramids import RESULT, TRACKS, described, is_bottom_up, pyramid, states, stop_after, take, work_off

JOBS = len(pyramid(tracks=TRACKS[:1]))
TOP = BlockId(0, 0, 0)


@pytest.fixture(autouse=True)
def _small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    """Makes every job a batch of its own, so that a plan can stop between any two."""
    for module in (sqlite_jobs, mongodb_plan):
        monkeypatch.setattr(module, "PLAN_BATCH", 1)


Prepare = Callable[[Catalogue], None]


def _new(_catalogue: Catalogue) -> None: ...


def _all_done(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", pyramid(tracks=TRACKS[:1]))
    work_off(catalogue)
    catalogue.announce("town-a", 1)


def _half_done(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", pyramid(tracks=TRACKS[:1]))
    for _ in range(4):
        catalogue.done(take(catalogue), RESULT)
    catalogue.announce("town-a", 1)


def _cancelled(catalogue: Catalogue) -> None:
    _half_done(catalogue)
    catalogue.cancel("town-a")


@pytest.mark.parametrize("prepare", [_new, _all_done, _half_done, _cancelled])
def test_killed_plan_is_completed_by_the_same_plan(make_catalogue: Callable[[], Catalogue], prepare: Prepare) -> None:
    wanted = pyramid("abXd", tracks=TRACKS[:1])
    undisturbed = make_catalogue()
    prepare(undisturbed)
    undisturbed.plan("town-a", wanted)
    for count in range(JOBS + 1):
        catalogue = make_catalogue()
        prepare(catalogue)
        with pytest.raises(RuntimeError, match="stopped"):
            catalogue.plan("town-a", stop_after(wanted, count))
        catalogue.plan("town-a", wanted)
        assert described(catalogue) == described(undisturbed)
        assert catalogue.rendering("town-a") == undisturbed.rendering("town-a")
        assert catalogue.count_jobs("town-a") == undisturbed.count_jobs("town-a")
        assert catalogue.plan("town-a", wanted) == PlanCounts(kept=JOBS)


def test_work_between_a_killed_plan_and_its_repetition_is_kept_or_done_again(make_catalogue: Callable[[], Catalogue]) -> None:
    """At the end every job is done under its new key, and no reduce job was done before the jobs below it."""
    wanted = pyramid("XbcX", tracks=TRACKS[:1])
    for count in range(JOBS + 1):
        catalogue = make_catalogue()
        _all_done(catalogue)
        with pytest.raises(RuntimeError):
            catalogue.plan("town-a", stop_after(wanted, count))
        work_off(catalogue)
        catalogue.plan("town-a", wanted)
        blocks = work_off(catalogue)
        assert is_bottom_up(blocks)
        assert [(job.key, job.state) for job in catalogue.jobs("town-a", TRACKS[0])] == [
            (job.key, State.DONE) for job in sorted(wanted, key=lambda job: (job.block.z, job.order))
        ]


@pytest.mark.parametrize("count", range(1, JOBS + 1))
def test_reduce_jobs_above_a_changed_job_wait_at_once(catalogue: Catalogue, count: int) -> None:
    """No worker renders a reduce block between the change of a block below and its own."""
    _all_done(catalogue)
    wanted = pyramid("Xbcd", tracks=TRACKS[:1])
    with suppress(RuntimeError):
        catalogue.plan("town-a", stop_after(wanted, count, lambda: check_top_waits(catalogue)))
    check_top_waits(catalogue)


def check_top_waits(catalogue: Catalogue) -> None:
    assert states(catalogue, State.WAITING) == [TOP, BlockId(3, 0, 0)]
    lease = catalogue.lease("town-a", "w")
    assert lease is not None
    assert lease.block == BlockId(6, 0, 0)
    assert catalogue.lease("town-a", "w") is None
    catalogue.release(lease)


def test_lease_of_a_reduce_job_is_stale_when_a_job_below_changes(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", pyramid(tracks=TRACKS[:1]))
    while (lease := take(catalogue)).kind == "base":
        catalogue.done(lease, RESULT)

    def done_in_between() -> None:
        with pytest.raises(StaleFence):
            catalogue.done(lease, RESULT)

    with pytest.raises(RuntimeError):
        catalogue.plan("town-a", stop_after(pyramid("Xbcd", tracks=TRACKS[:1]), 1, done_in_between))
    done_in_between()


def test_planned_jobs_can_be_leased_before_the_plan_ends(catalogue: Catalogue) -> None:
    leased = []

    def jobs() -> Iterator[PlannedJob]:
        for number, job in enumerate(pyramid(tracks=TRACKS[:1])):
            yield job
            if number == 1:
                leased.append(take(catalogue).block)

    catalogue.plan("town-a", jobs())
    assert leased == [BlockId(6, 0, 0)]


def test_content_version_is_raised_before_the_first_job_opens(catalogue: Catalogue) -> None:
    _all_done(catalogue)
    versions = []

    def jobs() -> Iterator[PlannedJob]:
        for job in pyramid("Xbcd", tracks=TRACKS[:1]):
            yield job
            versions.append(catalogue.rendering("town-a").content_version)

    catalogue.plan("town-a", jobs())
    assert set(versions) == {2}
    assert take(catalogue).content_version == 2


def test_version_announced_during_a_plan_is_raised_again(catalogue: Catalogue) -> None:
    _all_done(catalogue)

    def announcing() -> Iterator[PlannedJob]:
        for number, job in enumerate(pyramid("XbcX", tracks=TRACKS[:1])):
            yield job
            if number == 1:
                catalogue.announce("town-a", 2)

    catalogue.plan("town-a", announcing())
    assert catalogue.rendering("town-a").content_version == 3


def test_plan_without_changes_keeps_the_version(catalogue: Catalogue) -> None:
    _all_done(catalogue)
    catalogue.plan("town-a", pyramid(tracks=TRACKS[:1]))
    assert catalogue.rendering("town-a").content_version == 1


def test_unfinished_plan_is_marked_until_it_is_repeated(catalogue: Catalogue) -> None:
    with pytest.raises(RuntimeError):
        catalogue.plan("town-a", stop_after(pyramid(), 0))
    assert not catalogue.rendering("town-a").planning, "nothing changed"
    with pytest.raises(RuntimeError):
        catalogue.plan("town-a", stop_after(pyramid(), 2))
    assert catalogue.rendering("town-a").planning
    catalogue.plan("town-a", pyramid())
    assert not catalogue.rendering("town-a").planning


def test_plan_of_an_unknown_rendering_is_refused(catalogue: Catalogue) -> None:
    with pytest.raises(NotFound, match="nowhere"):
        catalogue.plan("nowhere", pyramid())


def test_jobs_are_yielded_in_order_across_pages(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (sqlite_jobs, mongodb_jobs, mongodb_plan):
        monkeypatch.setattr(module, "PAGE", 3)
    catalogue.plan("town-a", pyramid())
    catalogue.done(take(catalogue), RESULT)
    jobs = list(catalogue.jobs("town-a"))
    expected = sorted(pyramid(), key=lambda job: (job.track, job.block.z, job.order))
    assert [(job.track, job.block, job.key) for job in jobs] == [(job.track, job.block, job.key) for job in expected]
    for track in TRACKS:
        assert list(catalogue.jobs("town-a", track)) == [job for job in jobs if job.track == track]
    for state in State:
        assert list(catalogue.jobs("town-a", state=state)) == [job for job in jobs if job.state is state]
        assert list(catalogue.jobs("town-a", TRACKS[1], state)) == [job for job in jobs if job.state is state and job.track == TRACKS[1]]


def test_counts_agree_with_the_jobs_after_every_change(catalogue: Catalogue) -> None:
    def check() -> None:
        assert catalogue.count_jobs("town-a") == dict.fromkeys(State, 0) | Counter(job.state for job in catalogue.jobs("town-a"))

    check()
    catalogue.plan("town-a", pyramid())
    check()
    for call in (lambda lease: catalogue.done(lease, RESULT), lambda lease: catalogue.fail(lease, verbatim("bad")), catalogue.release):
        call(take(catalogue))
        check()
    take(catalogue, "gone")
    catalogue.expire("town-a", ["gone"])
    check()
    catalogue.cancel("town-a", [(TRACKS[0], BlockId(6, 24, 0)), (TRACKS[0], TOP)])
    check()
    catalogue.retry("town-a")
    check()
    work_off(catalogue)
    check()
    catalogue.reopen("town-a", [(TRACKS[1], BlockId(6, 0, 0))])
    check()
