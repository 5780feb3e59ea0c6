"""The events of a run."""

from dataclasses import dataclass

from map3d.catalogue import JobResult, Lease, PlanCounts, State
from map3d.messages import Message


@dataclass(frozen=True)
class JobDone:
    lease: Lease
    result: JobResult


@dataclass(frozen=True)
class JobFailed:
    """A job lost one attempt; `state` is its state afterwards."""

    lease: Lease
    reason: Message
    state: State


@dataclass(frozen=True)
class LeaseLost:
    """A lease was released, or another worker took it over; the job was not committed as done."""

    lease: Lease
    reason: Message


@dataclass(frozen=True)
class SceneChanged:
    """The scene was rebuilt after the job had been planned. The job was released without losing an attempt; a run that plans does so again."""

    lease: Lease
    reason: Message


@dataclass(frozen=True)
class WorkerExited:
    """A worker exited. `reason` is None when no jobs were left or the run was stopped; `jobs_failed`: it exited after too many failed jobs;
    `error`: an unexpected exception."""

    worker: str
    reason: Message | None = None
    jobs_failed: bool = False
    error: BaseException | None = None


@dataclass(frozen=True)
class Stopping:
    """The user asked to stop: `at_once`, or after the current jobs."""

    at_once: bool


@dataclass(frozen=True)
class Waiting:
    """All remaining jobs are leased by another run, or by a killed one whose leases have not expired yet."""

    jobs: int


@dataclass(frozen=True)
class Planned:
    """The run planned the rendering; `open_jobs` are to do, by this run or others."""

    counts: PlanCounts
    open_jobs: int


@dataclass(frozen=True)
class Remaining:
    """The number of jobs that are not done now; other runs may do some of them."""

    jobs: int


@dataclass(frozen=True)
class PlanAwaited:
    """The scene was rebuilt, and this process does not plan: it tries again after a pause, when the rendering may have been planned again."""

    rendering: str


@dataclass(frozen=True)
class StoreAwaited:
    """`map3d work --forever` could not reach catalogue or tile store, and tries again after a pause."""

    reason: str


@dataclass(frozen=True)
class RenderingStarted:
    """`map3d work` starts with a rendering that has `open_jobs`."""

    rendering: str
    open_jobs: int


@dataclass(frozen=True)
class RenderingSkipped:
    """`map3d work` does not work on a rendering."""

    rendering: str
    reason: str


@dataclass(frozen=True)
class RenderingLeft:
    """`map3d work` leaves a rendering: no jobs are left, or the user stopped it. `complete`: all jobs are done and its manifest is written."""

    rendering: str
    complete: bool


JobOutcome = JobDone | JobFailed | LeaseLost | SceneChanged
WorkEvent = PlanAwaited | StoreAwaited | RenderingStarted | RenderingSkipped | RenderingLeft
RunEvent = JobOutcome | WorkerExited | Stopping | Waiting | Planned | Remaining | WorkEvent
