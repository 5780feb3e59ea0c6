"""The problems of a run as lines of text, for terminals and logs."""

from map3d.jobs import events
from map3d.jobs.events import RunEvent


def problem_text(event: RunEvent) -> str:
    """Returns the line that reports a problem, empty for other events."""
    if isinstance(event, events.JobFailed):
        lease = event.lease
        return f"{lease.track} {lease.block}: attempt {lease.attempt} failed ({event.reason}); the block is now {event.state}"
    if isinstance(event, events.LeaseLost):
        return f"{event.lease.track} {event.lease.block}: lease lost: {event.reason}"
    if isinstance(event, events.SceneChanged):
        return "files changed during the render"
    if isinstance(event, events.WorkerExited) and event.reason:
        return f"worker {event.worker} exited: {event.reason}"
    return ""
