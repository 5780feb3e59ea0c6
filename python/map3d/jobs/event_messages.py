"""The problems of a run as messages, for terminals and logs."""

from map3d.jobs import events
from map3d.jobs.events import RunEvent
from map3d.messages import Message, message


def problem_message(event: RunEvent) -> Message | None:
    """Returns the message that reports a problem, None for other events."""
    if isinstance(event, events.JobFailed):
        state = message(f"block-{event.state}")
        return message("block-failed", **_place(event), attempt=event.lease.attempt, reason=event.reason, state=state)
    if isinstance(event, events.LeaseLost):
        return message("lease-lost", **_place(event), reason=event.reason)
    if isinstance(event, events.SceneChanged):
        return message("files-changed")
    if isinstance(event, events.WorkerExited) and event.reason:
        return message("worker-exited", worker=event.worker, reason=event.reason)
    return None


def _place(event: events.JobFailed | events.LeaseLost) -> dict[str, str]:
    return {"track": event.lease.track, "block": str(event.lease.block)}
