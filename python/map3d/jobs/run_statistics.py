"""Counts of what a run did."""

from dataclasses import dataclass, field

from map3d.jobs.events import JobDone, JobFailed, LeaseLost, RunEvent, WorkerExited


@dataclass
class RunStatistics:
    """`bytes`: encoded; `exit_reasons`: of workers that exited before the run ended."""

    done: int = 0
    empty: int = 0
    tiles: int = 0
    base_tiles: int = 0
    bytes: int = 0
    failed_attempts: int = 0
    lost_leases: int = 0
    exit_reasons: list[str] = field(default_factory=list)

    def add(self, event: RunEvent) -> None:
        if isinstance(event, JobDone):
            self.done += 1
            self.empty += event.result.empty
            self.tiles += event.result.tiles
            self.base_tiles += event.result.base_tiles
            self.bytes += event.result.bytes
        elif isinstance(event, JobFailed):
            self.failed_attempts += 1
        elif isinstance(event, LeaseLost):
            self.lost_leases += 1
        elif isinstance(event, WorkerExited) and event.reason:
            self.exit_reasons.append(f"{event.worker}: {event.reason}")
