"""A small pyramid of jobs, and the parts of jobs that two plans must agree in."""

from collections.abc import Callable, Iterator, Sequence

from map3d.catalogue import Catalogue, JobResult, Lease, PlannedJob, State
from map3d.types import BlockId

TRACKS = ("0-45", "90-45")
RESULT = JobResult(version=1, empty=False, tiles=3, base_tiles=1, bytes=100, seconds=0.5, occupied=(1 << 63) | 5)


def pyramid(keys: str = "abcd", root: str = "r", tracks: Sequence[str] = TRACKS) -> list[PlannedJob]:
    """Returns, for each track, four base blocks, the two reduce blocks above them and the top; a reduce block's key contains the keys below."""
    jobs = []
    for track in tracks:
        jobs += [PlannedJob(track, BlockId(6, 4 * n, 0), "base", 16 * n, key, BlockId(3, n // 2, 0)) for n, key in enumerate(keys)]
        pairs = (keys[:2], keys[2:])
        jobs += [PlannedJob(track, BlockId(3, n, 0), "reduce", n, root + pair, BlockId(0, 0, 0)) for n, pair in enumerate(pairs)]
        jobs.append(PlannedJob(track, BlockId(0, 0, 0), "reduce", 0, root + keys, None))
    return jobs


def take(catalogue: Catalogue, worker: str = "w") -> Lease:
    lease = catalogue.lease("town-a", worker)
    assert lease is not None
    return lease


def work_off(catalogue: Catalogue) -> list[BlockId]:
    """Does all jobs as a worker would; returns their blocks in order."""
    blocks = []
    while True:
        while (lease := catalogue.lease("town-a", "w")) is not None:
            catalogue.done(lease, RESULT)
            blocks.append(lease.block)
        if not catalogue.sweep("town-a"):
            return blocks


def is_bottom_up(blocks: Sequence[BlockId]) -> bool:
    """Returns whether every block comes after all blocks below it."""
    return not any(is_below(later, block) for number, block in enumerate(blocks) for later in blocks[number:])


def is_below(block: BlockId, above: BlockId) -> bool:
    down = block.z - above.z
    return down > 0 and (block.x >> down, block.y >> down) == (above.x, above.y)


def stop_after(jobs: Sequence[PlannedJob], count: int, act: Callable[[], None] = lambda: None) -> Iterator[PlannedJob]:
    """Yields `count` jobs, calls `act` and fails as a killed plan would."""
    yield from jobs[:count]
    act()
    raise RuntimeError("stopped")


def described(catalogue: Catalogue) -> list[tuple[object, ...]]:
    """Returns what two catalogues must agree in: everything but fences, whose number depends on the number of changes."""
    return [
        (job.track, job.block, job.kind, job.key, job.state, job.attempts, job.expiries, job.worker, job.result) for job in catalogue.jobs("town-a")
    ]


def states(catalogue: Catalogue, state: State) -> list[BlockId]:
    return [job.block for job in catalogue.jobs("town-a", TRACKS[0], state)]
