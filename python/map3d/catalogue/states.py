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
    CANCELLED = "cancelled"


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
    PLAN = "plan"
    CANCEL = "cancel"
    REOPEN = "reopen"
    BELOW_REOPENED = "below reopened"
    EVICT = "evict"


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
    (State.CANCELLED, JobEvent.RETRY): State.TODO,
    (State.CANCELLED, JobEvent.PLAN): State.TODO,
    (State.CANCELLED, JobEvent.KEY_CHANGED): State.TODO,
    (State.WAITING, JobEvent.CANCEL): State.CANCELLED,
    (State.TODO, JobEvent.CANCEL): State.CANCELLED,
    (State.LEASED, JobEvent.CANCEL): State.CANCELLED,
    (State.DONE, JobEvent.REOPEN): State.TODO,
    (State.DONE, JobEvent.EVICT): State.LEASED,
    (State.WAITING, JobEvent.BELOW_REOPENED): State.WAITING,
    (State.TODO, JobEvent.BELOW_REOPENED): State.WAITING,
    (State.LEASED, JobEvent.BELOW_REOPENED): State.WAITING,
    (State.DONE, JobEvent.BELOW_REOPENED): State.WAITING,
}


def next_state(state: State, event: JobEvent) -> State | None:
    """Returns the state after `event`, None when the event is refused. The catalogue itself quarantines a job after MAX_ATTEMPTS or MAX_EXPIRIES, and
    makes a reduce job wait for the blocks below after a plan, retry or reopening."""
    return TRANSITIONS.get((state, event))


def sources(event: JobEvent) -> tuple[State, ...]:
    """Returns the states in which `event` is accepted."""
    return tuple(state for state, accepted in TRANSITIONS if accepted is event)
