"""The events of a run."""

from dataclasses import dataclass

from map3d.catalogue import JobResult, Lease, State


@dataclass(frozen=True)
class JobDone:
    lease: Lease
    result: JobResult


@dataclass(frozen=True)
class JobFailed:
    """A job lost one attempt; `state` is its state afterwards."""

    lease: Lease
    reason: str
    state: State


@dataclass(frozen=True)
class LeaseLost:
    """A lease was released, or another worker took it over; the job was not committed as done."""

    lease: Lease
    reason: str


@dataclass(frozen=True)
class SceneChanged:
    """The scene was rebuilt after the job had been planned. The job was released without losing an attempt; the run plans again."""

    lease: Lease
    reason: str


@dataclass(frozen=True)
class WorkerExited:
    """A worker exited. `reason` is empty when no jobs were left or the run was stopped; `jobs_failed`: it exited after too many failed jobs;
    `error`: an unexpected exception."""

    worker: str
    reason: str = ""
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


RunEvent = JobDone | JobFailed | LeaseLost | SceneChanged | WorkerExited | Stopping | Waiting
