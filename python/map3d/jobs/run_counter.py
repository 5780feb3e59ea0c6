"""Counts the blocks of a run from its events."""

from dataclasses import dataclass

from map3d.jobs import events
from map3d.jobs.events import RunEvent


@dataclass
class RunCounter:
    """`done` of `total` blocks, whichever run does them. Pass it every event."""

    done: int = 0
    total: int = 0

    def __call__(self, event: RunEvent) -> None:
        if isinstance(event, events.Planned):
            self.done, self.total = 0, event.open_jobs
        elif isinstance(event, events.JobDone):
            self.done = min(self.done + 1, self.total)
        elif isinstance(event, events.Remaining):
            self.total = max(self.total, event.jobs)
            self.done = self.total - event.jobs
