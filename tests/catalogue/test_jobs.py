"""Laws of jobs: states, leases, fences (spec/catalogue.md)."""

import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, Job, JobResult, Lease, PlannedJob, State
from map3d.catalogue.sqlite import SqliteCatalogue
from map3d.catalogue.sqlite_plan import SQL
from map3d.catalogue.states import MAX_ATTEMPTS, MAX_EXPIRIES, TRANSITIONS, JobEvent
from map3d.errors import StaleFence
from map3d.messages import message, verbatim
from map3d.types import BlockId
from tests.catalogue.implementations import LEASE_S

TOP = BlockId(0, 0, 0)
RESULT = JobResult(version=1, empty=False, tiles=3, base_tiles=1, bytes=100, seconds=0.5)


def base(x: int = 0, key: str = "k", above: BlockId | None = TOP, track: str = "0-45", ground: int = 0) -> PlannedJob:
    return PlannedJob(track, BlockId(3, x, 0), "base", x, key, above, ground)


def reduce(key: str = "r") -> PlannedJob:
    return PlannedJob("0-45", TOP, "reduce", 0, key, None)


def take(catalogue: Catalogue) -> Lease:
    lease = catalogue.lease("town-a", "w")
    assert lease is not None
    return lease


def only(catalogue: Catalogue, state: State | None = None) -> Job:
    (job,) = [job for job in catalogue.jobs("town-a") if job.kind == "base" and state in (None, job.state)]
    return job


def test_jobs_of_equal_ground_are_leased_in_morton_order_with_rising_fences(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(2), base(0), base(1)])
    leases = [take(catalogue) for _ in range(3)]
    assert [lease.block.x for lease in leases] == [0, 1, 2]
    assert catalogue.lease("town-a", "w") is None
    catalogue.release(leases[0])
    again = take(catalogue)
    assert again.fence > leases[0].fence
    assert again.attempt == 1


def test_times_of_a_job_are_on_the_databases_clock(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base()])
    assert (only(catalogue).leased_s, only(catalogue).ended_s) == (None, None)
    before_s = catalogue.clock_s()
    lease = take(catalogue)
    leased = only(catalogue)
    assert leased.leased_s is not None
    assert leased.expires_s is not None
    assert before_s <= leased.leased_s <= catalogue.clock_s()
    assert leased.expires_s - leased.leased_s == pytest.approx(catalogue.lease_s, abs=0.01)
    catalogue.heartbeat(lease)
    assert only(catalogue).leased_s == leased.leased_s
    catalogue.done(lease, RESULT)
    done = only(catalogue)
    assert done.ended_s is not None
    assert leased.leased_s <= done.ended_s <= catalogue.clock_s()


def test_reduce_job_waits_for_all_blocks_below(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [reduce(), base(0), base(1)])
    first, second = take(catalogue), take(catalogue)
    assert catalogue.lease("town-a", "w") is None
    catalogue.done(first, RESULT)
    assert catalogue.lease("town-a", "w") is None
    catalogue.done(second, RESULT)
    assert take(catalogue).block == TOP


def test_quarantined_block_keeps_its_reduce_job_waiting(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [reduce(), base(0)])
    for attempt in range(1, MAX_ATTEMPTS + 1):
        lease = take(catalogue)
        assert lease.attempt == attempt
        state = catalogue.fail(lease, verbatim(f"bad {attempt}"))
    assert state is State.QUARANTINED
    assert only(catalogue).reason == verbatim("bad 3")
    assert catalogue.lease("town-a", "w") is None
    counts = catalogue.count_jobs("town-a")
    assert (counts[State.WAITING], counts[State.QUARANTINED]) == (1, 1)


def test_jobs_of_all_tracks_are_leased_along_the_ground(catalogue: Catalogue) -> None:
    grounds = {("0-45", 0): 5, ("0-45", 1): 2, ("0-45", 2): 7, ("90-45", 0): 2, ("90-45", 1): 1 << 40, ("90-45", 2): 6}
    catalogue.plan("town-a", [base(x, above=None, track=track, ground=ground) for (track, x), ground in grounds.items()])
    for start, expected in ((0, [2, 2, 5, 6, 7, 1 << 40]), (6, [6, 7, 1 << 40, 2, 2, 5])):
        leases = [lease for _ in grounds if (lease := catalogue.lease("town-a", "w", start)) is not None]
        assert [lease.ground for lease in leases] == expected
        assert all(grounds[lease.track, lease.block.x] == lease.ground for lease in leases)
        assert [lease.track for lease in leases if lease.ground == 2] == ["0-45", "90-45"]
        for lease in leases:
            catalogue.release(lease)
    assert {(job.track, job.block.x): job.ground for job in catalogue.jobs("town-a")} == grounds


def test_a_changed_block_takes_the_hilbert_index_of_the_new_plan(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(ground=3)])
    catalogue.plan("town-a", [base(key="changed", ground=4)])
    assert only(catalogue).ground == 4


def test_reduce_jobs_come_before_base_jobs_of_any_ground(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0, ground=9), base(0, track="90-45", above=None), reduce()])
    first = catalogue.lease("town-a", "w", 9)
    assert first is not None
    catalogue.done(first, RESULT)
    second = catalogue.lease("town-a", "w", 9)
    assert second is not None
    assert (second.kind, second.block) == ("reduce", TOP)


def test_lease_starts_at_a_hilbert_index_and_wraps_around(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [reduce(), *(base(x, ground=x) for x in range(4))])
    third = 2
    taken = [catalogue.lease("town-a", "w", third) for _ in range(4)]
    assert [lease.block.x for lease in taken if lease is not None] == [2, 3, 0, 1]
    for lease in taken:
        assert lease is not None
        catalogue.release(lease)
    again = catalogue.lease("town-a", "w", third)
    assert again is not None
    catalogue.fail(again, verbatim("bad"))
    after = [catalogue.lease("town-a", "w", third) for _ in range(4)]
    assert [lease.block.x for lease in after if lease is not None] == [3, 0, 1, 2], "what failed comes last"


def test_retry_allows_a_quarantined_job_three_more_attempts(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0), base(1)])
    while (lease := catalogue.lease("town-a", "w")) is not None:
        catalogue.fail(lease, verbatim("bad"))
    assert catalogue.retry("town-a", [("0-45", BlockId(3, 1, 0))]) == 1
    assert take(catalogue).attempt == 1
    assert catalogue.retry("town-a") == 1
    assert catalogue.retry("town-a") == 0


def test_failed_jobs_go_to_the_end_of_the_queue(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0), base(1)])
    catalogue.fail(take(catalogue), verbatim("bad"))
    assert take(catalogue).block.x == 1
    assert take(catalogue).block.x == 0


def test_job_of_a_killed_worker_is_leased_again(brief_catalogue: Catalogue) -> None:
    brief_catalogue.plan("town-a", [base()])
    first = take(brief_catalogue)
    assert brief_catalogue.lease("town-a", "other") is None
    time.sleep(LEASE_S + 0.1)
    second = take(brief_catalogue)
    assert second.attempt == 1, "being killed is not failing"
    assert second.fence > first.fence
    assert only(brief_catalogue).expiries == 1


@pytest.mark.parametrize("word", ["heartbeat", "done", "fail", "release"])
def test_stale_fence_is_refused(brief_catalogue: Catalogue, word: str) -> None:
    brief_catalogue.plan("town-a", [base()])
    stale = take(brief_catalogue)
    time.sleep(LEASE_S + 0.1)
    fresh = take(brief_catalogue)
    with pytest.raises(StaleFence, match="no longer held"):
        say(brief_catalogue, word, stale)
    brief_catalogue.done(fresh, RESULT)
    with pytest.raises(StaleFence):
        say(brief_catalogue, word, fresh)


@pytest.mark.parametrize("word", ["heartbeat", "done", "fail", "release"])
def test_expired_lease_is_refused_even_when_the_job_is_free(brief_catalogue: Catalogue, word: str) -> None:
    brief_catalogue.plan("town-a", [base()])
    lease = take(brief_catalogue)
    time.sleep(LEASE_S + 0.1)
    with pytest.raises(StaleFence):
        say(brief_catalogue, word, lease)


def test_heartbeats_renew_a_lease(brief_catalogue: Catalogue) -> None:
    brief_catalogue.plan("town-a", [base()])
    lease = take(brief_catalogue)
    for _ in range(6):
        time.sleep(LEASE_S / 4)
        brief_catalogue.heartbeat(lease)
    brief_catalogue.done(lease, RESULT)
    assert only(brief_catalogue).state is State.DONE


def test_lease_that_expires_three_times_does_not_quarantine_the_job(brief_catalogue: Catalogue) -> None:
    brief_catalogue.plan("town-a", [base()])
    for _ in range(3):
        take(brief_catalogue)
        time.sleep(LEASE_S + 0.1)
    assert take(brief_catalogue).attempt == 1
    assert (only(brief_catalogue).attempts, only(brief_catalogue).expiries) == (1, 3)


def test_tenth_expired_lease_quarantines_the_job(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base()])
    for _ in range(MAX_EXPIRIES):
        take(catalogue)
        assert catalogue.expire("town-a", ["w"]) == 1
    assert catalogue.lease("town-a", "w") is None
    assert only(catalogue, State.QUARANTINED).reason == message("lease-expired", count=10, worker="w")
    assert catalogue.retry("town-a") == 1
    assert (take(catalogue).attempt, only(catalogue).expiries) == (1, 0)


def test_expired_leases_do_not_add_to_failed_attempts(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base()])
    for attempt in range(1, MAX_ATTEMPTS + 1):
        take(catalogue)
        catalogue.expire("town-a", ["w"])
        state = catalogue.fail(take(catalogue), verbatim(f"bad {attempt}"))
    assert state is State.QUARANTINED
    assert (only(catalogue).attempts, only(catalogue).expiries) == (MAX_ATTEMPTS, MAX_ATTEMPTS)


def test_only_leases_of_the_named_workers_expire(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0), base(1)])
    mine, other = take(catalogue), catalogue.lease("town-a", "other")
    assert other is not None
    assert catalogue.expire("town-a", ["w", "unknown"]) == 1
    with pytest.raises(StaleFence):
        catalogue.done(mine, RESULT)
    catalogue.done(other, RESULT)


def test_job_whose_lease_expired_goes_to_the_end_of_the_queue(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0), base(1)])
    take(catalogue)
    catalogue.expire("town-a", ["w"])
    assert [take(catalogue).block.x for _ in range(2)] == [1, 0]


def test_result_of_a_done_job_is_stored(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base()])
    catalogue.done(take(catalogue), RESULT)
    assert only(catalogue).result == RESULT


def test_only_changed_keys_reopen_jobs(catalogue: Catalogue) -> None:
    assert catalogue.plan("town-a", [base(0), base(1)]).added == 2
    for _ in range(2):
        catalogue.done(take(catalogue), RESULT)
    assert catalogue.plan("town-a", [base(0), base(1)]).kept == 2
    assert catalogue.lease("town-a", "w") is None
    outcome = catalogue.plan("town-a", [base(0, "new"), base(1)])
    assert (outcome.changed, outcome.kept) == (1, 1)
    lease = take(catalogue)
    assert (lease.block.x, lease.key, lease.attempt) == (0, "new", 1)


def test_changed_key_makes_the_running_lease_stale(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0)])
    lease = take(catalogue)
    catalogue.plan("town-a", [base(0, "new")])
    with pytest.raises(StaleFence):
        catalogue.done(lease, RESULT)


def test_reduce_job_with_a_changed_key_waits_again(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [reduce(), base(0), base(1)])
    while (lease := catalogue.lease("town-a", "w")) is not None:
        catalogue.done(lease, RESULT)
    catalogue.plan("town-a", [reduce("r2"), base(0, "k2"), base(1)])
    lease = take(catalogue)
    assert lease.kind == "base"
    assert catalogue.lease("town-a", "w") is None
    catalogue.done(lease, RESULT)
    assert take(catalogue).kind == "reduce"


def test_reduce_job_above_done_blocks_opens_at_once(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [reduce(), base(0)])
    while (lease := catalogue.lease("town-a", "w")) is not None:
        catalogue.done(lease, RESULT)
    catalogue.plan("town-a", [reduce("r2"), base(0)])
    assert take(catalogue).kind == "reduce"


def test_content_version_increases_after_it_was_announced(catalogue: Catalogue) -> None:
    catalogue.plan("town-a", [base(0)])
    catalogue.plan("town-a", [base(0, "k2")])
    assert catalogue.rendering("town-a").content_version == 1
    catalogue.announce("town-a", 1)
    catalogue.plan("town-a", [base(0, "k3")])
    lease = take(catalogue)
    assert lease.content_version == 2
    catalogue.done(lease, RESULT)
    catalogue.announce("town-a", 2)
    catalogue.plan("town-a", [base(0, "k3")])
    assert catalogue.rendering("town-a").content_version == 2


def test_events_are_refused_in_states_that_the_table_does_not_list(catalogue: Catalogue) -> None:
    """Brings a job into each state and sends each event of a lease holder."""
    words = {"heartbeat": JobEvent.HEARTBEAT, "done": JobEvent.DONE, "fail": JobEvent.FAIL, "release": JobEvent.RELEASE}
    seen: dict[State, set[JobEvent]] = {}
    for x, state in enumerate((State.TODO, State.LEASED, State.DONE, State.QUARANTINED)):
        seen[state] = {event for n, (word, event) in enumerate(words.items()) if accepted(catalogue, 10 * x + n, state, word)}
    assert seen == {state: {event for event in words.values() if (state, event) in TRANSITIONS} for state in seen}


def accepted(catalogue: Catalogue, x: int, state: State, word: str) -> bool:
    catalogue.plan("town-a", [base(x)])
    lease = take(catalogue)
    if state is State.TODO:
        catalogue.release(lease)
    elif state is State.DONE:
        catalogue.done(lease, RESULT)
    elif state is State.QUARANTINED:
        while catalogue.fail(lease, verbatim("bad")) is not State.QUARANTINED:
            lease = take(catalogue)
    try:
        say(catalogue, word, lease)
    except StaleFence:
        return False
    finally:
        while (left := catalogue.lease("town-a", "w")) is not None:
            catalogue.done(left, RESULT)
    return True


def say(catalogue: Catalogue, word: str, lease: Lease) -> None:
    if word == "done":
        catalogue.done(lease, RESULT)
    elif word == "fail":
        catalogue.fail(lease, verbatim("bad"))
    elif word == "release":
        catalogue.release(lease)
    else:
        catalogue.heartbeat(lease)


def test_a_lease_in_sqlite_finds_its_job_in_an_index_without_sorting(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    SqliteCatalogue(path).close()
    with closing(sqlite3.connect(path)) as db:
        steps = [row[3] for row in db.execute(f"EXPLAIN QUERY PLAN {SQL['lease']}", {"rendering": "r", "worker": "w", "lease_s": 1, "start": 5})]
    found = [step for step in steps if "job_next" in step]
    assert len(found) == 3
    assert any(step.endswith("z=? AND ground>?)") for step in found)
    assert not any("TEMP B-TREE" in step or step.startswith("SCAN") for step in steps)
