"""The statements of jobs.sql move jobs between the states of states.py, and only between these."""

import re
from pathlib import Path

from map3d import catalogue
from map3d.catalogue.sqlite_plan import SQL
from map3d.catalogue.states import TRANSITIONS, JobEvent, State, sources

TEXT = Path(catalogue.__file__).with_name("jobs.sql").read_text(encoding="utf-8")
EVENTS = {name: [JobEvent(event) for event in events.split(", ")] for name, events in re.findall(r"^-- ([a-z_]+): (.*)$", TEXT, re.MULTILINE)}
UPDATES = {name: sql for name, sql in SQL.items() if "UPDATE job SET" in sql}
QUARANTINING, WAITING = {JobEvent.FAIL, JobEvent.EXPIRE}, {JobEvent.RETRY, JobEvent.REOPEN, JobEvent.KEY_CHANGED, JobEvent.PLAN}
"""Events after which the catalogue itself quarantines a job, or makes a reduce job wait."""


def from_states(sql: str) -> set[State]:
    """Returns the states to which the statement's condition restricts the job."""
    condition = sql.partition("WHERE")[2]
    found = re.findall(r"(?<![.\w])state (?:= ('\w+')|IN \(([^)]*)\))", condition)
    return {State(name) for one, several in found for name in re.findall(r"'(\w+)'", one + several)} or set(State)


def to_states(sql: str) -> set[State]:
    """Returns the states to which the statement may set the job."""
    assigned = re.search(r"\bSET state = (iif\(.*?\)(?=,)|'\w+')", sql)
    return {State(name) for name in re.findall(r"'(\w+)'", assigned[1]) if name != "base"} if assigned else from_states(sql)


def test_every_update_of_a_job_names_its_events() -> None:
    assert set(UPDATES) == set(EVENTS)
    assert {event for events in EVENTS.values() for event in events} == {event for _, event in TRANSITIONS}


def test_statements_start_from_the_states_that_accept_their_events() -> None:
    for event in JobEvent:
        of_event = [from_states(UPDATES[name]) for name, events in EVENTS.items() if event in events]
        moving = {state for state in sources(event) if TRANSITIONS[state, event] is not state or event is JobEvent.HEARTBEAT}
        allowed = {state for name, events in EVENTS.items() if event in events for each in events for state in sources(each)}
        assert moving <= set().union(*of_event) <= allowed, event


def test_statements_end_in_the_state_of_their_events() -> None:
    for name, events in EVENTS.items():
        for event in events:
            found, expected = to_states(UPDATES[name]), {TRANSITIONS[state, event] for state in sources(event)}
            own = ({State.QUARANTINED} if event in QUARANTINING else set()) | ({State.WAITING} if event in WAITING else set())
            assert found == expected | own, (name, event)
