"""States of a job and what moves it from one to the next: the table of spec/catalogue.md, in code. Homes take the words from here."""

from enum import StrEnum
from typing import Final

MAX_ATTEMPTS: Final = 3


class State(StrEnum):
    WAITING = "waiting"
    TODO = "todo"
    LEASED = "leased"
    DONE = "done"
    QUARANTINED = "quarantined"


class Event(StrEnum):
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
"""States of jobs that still want work."""

TRANSITIONS: Final[dict[tuple[State, Event], State]] = {
    (State.WAITING, Event.BELOW_DONE): State.TODO,
    (State.WAITING, Event.KEY_CHANGED): State.TODO,
    (State.TODO, Event.LEASE): State.LEASED,
    (State.TODO, Event.KEY_CHANGED): State.TODO,
    (State.LEASED, Event.HEARTBEAT): State.LEASED,
    (State.LEASED, Event.DONE): State.DONE,
    (State.LEASED, Event.FAIL): State.TODO,
    (State.LEASED, Event.EXPIRE): State.TODO,
    (State.LEASED, Event.RELEASE): State.TODO,
    (State.LEASED, Event.KEY_CHANGED): State.TODO,
    (State.DONE, Event.KEY_CHANGED): State.TODO,
    (State.QUARANTINED, Event.RETRY): State.TODO,
    (State.QUARANTINED, Event.KEY_CHANGED): State.TODO,
}


def next_state(state: State, event: Event, attempts: int = 0) -> State | None:
    """The state after `event`, None when the event is refused. A third failed attempt quarantines. For reduce jobs a changed key means waiting
    until the blocks below are done, which the home decides."""
    after = TRANSITIONS.get((state, event))
    if event in (Event.FAIL, Event.EXPIRE) and after is not None and attempts >= MAX_ATTEMPTS:
        return State.QUARANTINED
    return after


def sources(event: Event) -> tuple[State, ...]:
    """The states that `event` is accepted in."""
    return tuple(state for state, accepted in TRANSITIONS if accepted is event)
