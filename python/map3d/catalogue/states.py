"""The states of a job and the transitions between them: the table of spec/catalogue.md in code."""

from enum import StrEnum
from typing import Final

MAX_ATTEMPTS: Final = 3
MAX_EXPIRIES: Final = 10
"""An expired lease says little about the job: its worker was killed or suspended. A job whose leases always expire is quarantined too."""


class State(StrEnum):
    WAITING = "waiting"
    TODO = "todo"
    LEASED = "leased"
    DONE = "done"
    QUARANTINED = "quarantined"


class JobEvent(StrEnum):
    BELOW_DONE = "below done"
    LEASE = "lease"
    HEARTBEAT = "heartbeat"
    DONE = "done"
    FAIL = "fail"
    EXPIRE = "expire"
    RELEASE = "release"
    RETRY = "retry"
    KEY_CHANGED = "key changed"


OPEN: Final = (State.WAITING, State.TODO, State.LEASED)
"""The states of unfinished jobs."""

TRANSITIONS: Final[dict[tuple[State, JobEvent], State]] = {
    (State.WAITING, JobEvent.BELOW_DONE): State.TODO,
    (State.WAITING, JobEvent.KEY_CHANGED): State.TODO,
    (State.TODO, JobEvent.LEASE): State.LEASED,
    (State.TODO, JobEvent.KEY_CHANGED): State.TODO,
    (State.LEASED, JobEvent.HEARTBEAT): State.LEASED,
    (State.LEASED, JobEvent.DONE): State.DONE,
    (State.LEASED, JobEvent.FAIL): State.TODO,
    (State.LEASED, JobEvent.EXPIRE): State.TODO,
    (State.LEASED, JobEvent.RELEASE): State.TODO,
    (State.LEASED, JobEvent.KEY_CHANGED): State.TODO,
    (State.DONE, JobEvent.KEY_CHANGED): State.TODO,
    (State.QUARANTINED, JobEvent.RETRY): State.TODO,
    (State.QUARANTINED, JobEvent.KEY_CHANGED): State.TODO,
}


def next_state(state: State, event: JobEvent) -> State | None:
    """Returns the state after `event`, None when the event is refused. The catalogue itself quarantines a job after MAX_ATTEMPTS or MAX_EXPIRIES, and
    decides whether a reduce job with a changed key is todo or waits for the blocks below."""
    return TRANSITIONS.get((state, event))


def sources(event: JobEvent) -> tuple[State, ...]:
    """Returns the states in which `event` is accepted."""
    return tuple(state for state, accepted in TRANSITIONS if accepted is event)
