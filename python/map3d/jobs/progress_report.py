"""The progress of a rendering, from the catalogue alone: counts by level, rate, leases, failures."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

from map3d.catalogue import Catalogue, Job, State
from map3d.catalogue.states import OPEN
from map3d.jobs.dead_workers import process_of
from map3d.messages import Message
from map3d.process_identity import ProcessIdentity
from map3d.types import BlockId

RECENT_S: Final = 300.0
"""The rate is that of the jobs done in this time."""
MAX_LISTED: Final = 1000


@dataclass(frozen=True)
class LevelProgress:
    """The jobs of one track whose blocks have their root at `level`."""

    track: str
    level: int
    kind: str
    counts: dict[State, int]


@dataclass(frozen=True)
class HeldLease:
    """`seconds`: since the lease began; None when the job was leased by an earlier version of map3d."""

    worker: str
    host: str
    track: str
    block: BlockId
    kind: str
    attempt: int
    seconds: float | None


@dataclass(frozen=True)
class FailingJob:
    """A job in quarantine, or one that has failed and is tried again."""

    track: str
    block: BlockId
    kind: str
    state: State
    attempts: int
    expiries: int
    reason: Message | None


@dataclass(frozen=True)
class ProgressReport:
    """`jobs_per_s` and `seconds_left` are None while no job is leased or was done recently. `bytes` and `images` count the done blocks."""

    rendering: str
    counts: dict[State, int]
    levels: list[LevelProgress] = field(default_factory=list)
    leases: list[HeldLease] = field(default_factory=list)
    failing: list[FailingJob] = field(default_factory=list)
    images: int = 0
    bytes: int = 0
    jobs_per_s: float | None = None
    seconds_left: float | None = None

    @property
    def open_jobs(self) -> int:
        return sum(self.counts[state] for state in OPEN)

    @property
    def is_complete(self) -> bool:
        return self.counts[State.DONE] == sum(self.counts.values()) > 0


def report_progress(catalogue: Catalogue, rendering: str) -> ProgressReport:
    """Reads all jobs of the rendering once."""
    counts = catalogue.count_jobs(rendering)
    now_s = catalogue.clock_s()
    levels: dict[tuple[str, int, str], Counter[State]] = {}
    leases, failing, recent_s, images, size = list[HeldLease](), list[FailingJob](), list[float](), 0, 0
    for job in catalogue.jobs(rendering):
        levels.setdefault((job.track, job.block.z, job.kind), Counter())[job.state] += 1
        if job.state is State.LEASED:
            leases.append(_held(job, now_s))
        elif _is_failing(job) and len(failing) < MAX_LISTED:
            failing.append(FailingJob(job.track, job.block, job.kind, job.state, job.attempts, job.expiries, job.reason))
        elif job.state is State.DONE and job.result is not None:
            images, size = images + job.result.tiles, size + job.result.bytes
            if job.ended_s is not None and now_s - job.ended_s <= RECENT_S:
                recent_s.append(job.ended_s)
    rate = _rate(recent_s, now_s) if leases else None
    left_s = sum(counts[state] for state in OPEN) / rate if rate else None
    listed = [LevelProgress(track, level, kind, dict(found)) for (track, level, kind), found in sorted(levels.items())]
    return ProgressReport(rendering, counts, listed, leases, failing, images, size, rate, left_s)


def _held(job: Job, now_s: float) -> HeldLease:
    worker = job.worker or ""
    process = ProcessIdentity.parse(process_of(worker))
    seconds = None if job.leased_s is None else max(now_s - job.leased_s, 0.0)
    return HeldLease(worker, process.host if process else worker, job.track, job.block, job.kind, job.attempts, seconds)


def _is_failing(job: Job) -> bool:
    return job.state is State.QUARANTINED or (job.state is State.TODO and job.attempts + job.expiries > 0)


def _rate(recent_s: list[float], now_s: float) -> float | None:
    """Returns jobs per second since the first of the recent jobs ended."""
    if len(recent_s) < 2:
        return None
    return len(recent_s) / max(now_s - min(recent_s), 1e-3)
