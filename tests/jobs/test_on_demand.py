"""Blocks are rendered when they are asked for: once, in order, within the queue and the quota."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.catalogue import Job, State
from map3d.errors import LimitExceeded, Unavailable
from map3d.jobs.on_demand.block_requests import BlockRequest, BlockRequests
from map3d.jobs.on_demand.cache import OnDemandCache
from map3d.jobs.on_demand.on_demand import OnDemand
from map3d.jobs.on_demand.worker import OnDemandSettings, check_can_be_done
from map3d.tiles.track_stores import open_track
from map3d.types import BlockId
from tests.jobs.town import ENTRY, TIMEOUTS, VIEW, Town, planned_jobs

SETTINGS = OnDemandSettings(timeouts=replace(TIMEOUTS, block_s=20.0), entry=ENTRY)
TOP = BlockId(0, 0, 0)
WAIT_S = 60.0


@pytest.fixture
def start(town: Town) -> Iterator[Callable[..., OnDemand]]:
    opened: list[OnDemand] = []

    def start_one(settings: OnDemandSettings = SETTINGS) -> OnDemand:
        opened.append(OnDemand(town.workspace, settings))
        return opened[-1]

    yield start_one
    for one in opened:
        one.close()


def base(town: Town, x: int, y: int = 0) -> BlockId:
    return BlockId(town.rendering.zmax - 3, x, y)


def job_of(town: Town, block: BlockId) -> Job:
    job = town.catalogue.job("town-a", VIEW, block)
    assert job is not None
    return job


def ask(town: Town, one: OnDemand, block: BlockId) -> BlockRequest:
    return one.ask(job_of(town, block))


def rendered(faults: Path) -> int:
    """Returns the number of requests that subprocesses were sent."""
    return len((faults / "log").read_text().splitlines())


def is_stored(town: Town, block: BlockId) -> bool:
    with open_track(town.workspace, town.rendering, VIEW) as store:
        return store.get_block(block) is not None


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.02)


def test_a_block_is_rendered_and_stored(town: Town, faults: Path, start: Callable[..., OnDemand]) -> None:
    (faults / "log").touch()
    one = start()
    ask(town, one, base(town, 5)).ended.result(WAIT_S)
    assert job_of(town, base(town, 5)).state is State.DONE
    assert is_stored(town, base(town, 5))
    assert (rendered(faults), town.count(State.DONE), one.cache.addresses()) == (1, 1, [("town-a", VIEW, base(town, 5))])


def test_the_tiles_are_those_of_an_ordinary_render(town: Town, start: Callable[..., OnDemand], tmp_path: Path) -> None:
    ask(town, start(), TOP).ended.result(WAIT_S)
    assert town.count(State.DONE) == len(planned_jobs(town.rendering))
    on_demand = town.digest()
    town.catalogue.reopen("town-a", [(job.track, job.block) for job in town.catalogue.jobs("town-a")])
    town.run()
    assert town.digest() == on_demand


def test_many_requests_of_several_processes_render_a_block_once(town: Town, faults: Path, start: Callable[..., OnDemand]) -> None:
    (faults / "log").touch()
    (faults / "slow").write_text("0.3")
    several = [start(), start(), start()]
    job = job_of(town, base(town, 3))
    with ThreadPoolExecutor(20) as threads:
        demands = list(threads.map(lambda n: several[n % 3].ask(job), range(60)))
    for demand in demands:
        demand.ended.result(WAIT_S)
    assert rendered(faults) == 1
    assert sum(one.rendered for one in several) == 1


def test_a_tile_of_an_upper_level_has_the_blocks_below_rendered(town: Town, faults: Path, start: Callable[..., OnDemand]) -> None:
    (faults / "log").touch()
    jobs = len(planned_jobs(town.rendering))
    two = [start(), start()]
    for demand in [ask(town, one, TOP) for one in two]:
        demand.ended.result(WAIT_S)
    assert (rendered(faults), town.count(State.DONE)) == (jobs, jobs)


def test_base_blocks_are_rendered_before_reduce_blocks(town: Town, start: Callable[..., OnDemand]) -> None:
    one = start()
    overview = ask(town, one, TOP)
    ask(town, one, base(town, 7, 7)).ended.result(WAIT_S)
    assert not overview.ended.done()
    overview.ended.result(WAIT_S)


def test_too_many_blocks_below_are_refused(town: Town) -> None:
    top, settings = job_of(town, TOP), replace(SETTINGS, most_blocks=63)
    with pytest.raises(Unavailable, match="63 blocks"):
        check_can_be_done(town.catalogue, top, settings)
    check_can_be_done(town.catalogue, top, replace(SETTINGS, most_blocks=64))
    town.pool().run(lambda _: None)
    check_can_be_done(town.catalogue, job_of(town, base(town, 0)), settings)


def test_the_queue_is_bounded() -> None:
    demands = BlockRequests(2)
    first = demands.add(("r", VIEW, BlockId(3, 0, 0)), "base")
    demands.add(("r", VIEW, BlockId(3, 1, 0)), "base")
    assert demands.add(("r", VIEW, BlockId(3, 0, 0)), "base") is first
    with pytest.raises(Unavailable) as refused:
        demands.add(("r", VIEW, BlockId(3, 2, 0)), "base")
    assert refused.value.retry_s > 0
    demands.end(first)
    demands.add(("r", VIEW, BlockId(3, 2, 0)), "base")


def test_a_demand_without_clients_is_dropped() -> None:
    demands = BlockRequests(4)
    demand = demands.add(("r", VIEW, TOP), "reduce")
    demands.add(("r", VIEW, TOP), "reduce")
    demands.leave(demand, keep=False)
    assert len(demands) == 1
    demands.leave(demand, keep=False)
    assert len(demands) == 0
    kept = demands.add(("r", VIEW, TOP), "reduce")
    demands.leave(kept, keep=True)
    assert list(demands) == [kept]


def test_a_block_that_fails_three_times_is_reported(town: Town, faults: Path, start: Callable[..., OnDemand]) -> None:
    block = base(town, 2)
    (faults / f"{block.z}-{block.x}-{block.y}").write_text("segfault")
    one = start()
    with pytest.raises(Unavailable, match="failed three times"):
        ask(town, one, block).ended.result(WAIT_S)
    assert job_of(town, block).state is State.QUARANTINED
    with pytest.raises(Unavailable, match="map3d jobs retry town-a"):
        ask(town, one, block)
    ask(town, one, base(town, 1)).ended.result(WAIT_S)


def test_a_changed_scene_is_reported(town: Town, faults: Path, start: Callable[..., OnDemand]) -> None:
    block = base(town, 2)
    (faults / f"{block.z}-{block.x}-{block.y}").write_text("stale")
    with pytest.raises(Unavailable, match="--plan-only"):
        ask(town, start(), block).ended.result(WAIT_S)
    assert (job_of(town, block).state, job_of(town, block).attempts) == (State.TODO, 0)


def test_a_block_of_a_killed_process_is_rendered_again(town: Town, start: Callable[..., OnDemand]) -> None:
    lease = town.catalogue.lease_block("town-a", "elsewhere.0.1.0.1", VIEW, base(town, 4))
    assert lease is not None
    ask(town, start(), base(town, 4)).ended.result(WAIT_S)
    assert job_of(town, base(town, 4)).state is State.DONE


def test_a_request_waits_for_a_block_that_another_run_renders(town: Town, faults: Path, start: Callable[..., OnDemand]) -> None:
    (faults / "log").touch()
    (faults / "slow").write_text("0.02")
    run = threading.Thread(target=town.run)
    run.start()
    ask(town, start(), base(town, 7, 7)).ended.result(WAIT_S)
    run.join()
    assert rendered(faults) == len(planned_jobs(town.rendering))


def sizes(town: Town) -> int:
    """Returns the size of block (0, 0), which all blocks with content have within a few bytes."""
    result = job_of(town, base(town, 0)).result
    assert result is not None
    return result.bytes + 16


def test_the_least_recently_used_blocks_are_evicted(town: Town, start: Callable[..., OnDemand]) -> None:
    first = start()
    ask(town, first, base(town, 0)).ended.result(WAIT_S)
    one = start(replace(SETTINGS, quota_bytes=3 * sizes(town)))
    for x in (1, 2):
        ask(town, one, base(town, x)).ended.result(WAIT_S)
    one.cache.touch([("town-a", VIEW, base(town, 0))])
    ask(town, one, base(town, 3)).ended.result(WAIT_S)
    assert [place[2].x for place in one.cache.addresses()] == [2, 0, 3]
    assert one.cache.used_bytes() <= 3 * sizes(town)
    assert (job_of(town, base(town, 1)).state, is_stored(town, base(town, 1))) == (State.TODO, False)
    assert all(is_stored(town, base(town, x)) for x in (0, 2, 3))
    ask(town, one, base(town, 1)).ended.result(WAIT_S)
    assert is_stored(town, base(town, 1))


def test_an_evicted_block_gets_its_old_version_again(town: Town, start: Callable[..., OnDemand]) -> None:
    one = start()
    ask(town, one, base(town, 0)).ended.result(WAIT_S)
    before = job_of(town, base(town, 0)).result
    town.catalogue.announce("town-a", 1)
    small = start(replace(SETTINGS, quota_bytes=sizes(town)))
    ask(town, small, base(town, 1)).ended.result(WAIT_S)
    assert not is_stored(town, base(town, 0))
    ask(town, small, base(town, 0)).ended.result(WAIT_S)
    after = job_of(town, base(town, 0)).result
    assert before is not None
    assert after is not None
    assert (after.version, after.bytes) == (before.version, before.bytes)


def test_a_block_larger_than_the_quota_is_refused_and_loses_no_attempt(town: Town, start: Callable[..., OnDemand]) -> None:
    one = start(replace(SETTINGS, quota_bytes=100))
    with pytest.raises(Unavailable, match="--on-demand-quota"):
        ask(town, one, base(town, 0)).ended.result(WAIT_S)
    job = job_of(town, base(town, 0))
    assert (job.state, job.attempts) == (State.TODO, 0)
    assert one.cache.used_bytes() == 0


def test_blocks_of_complete_renderings_stay(town: Town, start: Callable[..., OnDemand]) -> None:
    one = start()
    ask(town, one, base(town, 0)).ended.result(WAIT_S)
    size = sizes(town)
    town.run()
    digest = town.digest()
    cache = OnDemandCache(town.workspace, town.catalogue, size, "w")
    town.catalogue.reopen("town-a", [(VIEW, base(town, 1))])
    lease = town.catalogue.lease_block("town-a", "w", VIEW, base(town, 1))
    assert lease is not None
    with pytest.raises(LimitExceeded):
        cache.reserve(lease, size + 1)
    town.catalogue.release(lease)
    assert not is_stored(town, base(town, 0)), "the rendering was not complete, so its block was evicted"
    town.run()
    assert town.digest() == digest
    lease = replace(lease, block=base(town, 2))
    cache.reserve(lease, size)
    cache.reserve(replace(lease, block=base(town, 3)), size)
    assert town.digest() == digest, "the rendering is complete"
    cache.close()


@pytest.mark.parametrize("step", ["heartbeat", "release"])
def test_an_eviction_that_is_killed_can_be_repeated(town: Town, start: Callable[..., OnDemand], step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    ask(town, start(), base(town, 0)).ended.result(WAIT_S)
    size = sizes(town)
    cache = OnDemandCache(town.workspace, town.catalogue, size, "killed")
    lease = town.catalogue.lease_block("town-a", "w", VIEW, base(town, 1))
    assert lease is not None

    def killed(*_: object) -> None:
        raise RuntimeError("killed")

    with monkeypatch.context() as patched:
        patched.setattr(type(town.catalogue), step, killed)
        with pytest.raises(RuntimeError, match="killed"):
            cache.reserve(lease, size)
    assert job_of(town, base(town, 0)).state is State.LEASED
    town.catalogue.expire("town-a", ["killed"])
    cache.reserve(lease, size)
    assert (job_of(town, base(town, 0)).state, is_stored(town, base(town, 0))) == (State.TODO, False)
    assert cache.addresses() == [("town-a", VIEW, base(town, 1))]
    cache.close()
