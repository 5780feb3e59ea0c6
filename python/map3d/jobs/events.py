"""What workers tell while they work."""

from dataclasses import dataclass

from map3d.catalogue import JobResult, Lease, State


@dataclass(frozen=True)
class Done:
    lease: Lease
    result: JobResult


@dataclass(frozen=True)
class Failed:
    """The job in hand lost an attempt; `state` is what it became."""

    lease: Lease
    reason: str
    state: State


@dataclass(frozen=True)
class Lost:
    """The lease was no longer held: somebody else has the job, nothing was committed as done."""

    lease: Lease
    reason: str


@dataclass(frozen=True)
class Left:
    """A worker's end. `because` is empty when there was nothing more to do or it was told to stop; `jobs_failed`: it left after failing too many;
    `error`: something that nobody foresaw."""

    worker: str
    because: str = ""
    jobs_failed: bool = False
    error: BaseException | None = None


@dataclass(frozen=True)
class Stopping:
    """The user asked to stop: at once when `abandoning`, else when the jobs in hand are done."""

    abandoning: bool


@dataclass(frozen=True)
class Waiting:
    """All that is left is leased by another run, or by one that was killed and whose leases have yet to expire."""

    jobs: int


Event = Done | Failed | Lost | Left | Stopping | Waiting
