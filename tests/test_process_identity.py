"""Identities of processes: a process that has ended is recognised, even when another one has its id."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from map3d.process_identity import ProcessIdentity

HERE = ProcessIdentity.current()


def test_text_is_parsed_back() -> None:
    for identity in (HERE, replace(HERE, host="render-1.example.org")):
        assert ProcessIdentity.parse(str(identity)) == identity


@pytest.mark.parametrize("text", ["", "local-1", "local", "a.b.c.d", "1.2.3"])
def test_other_text_is_no_identity(text: str) -> None:
    assert ProcessIdentity.parse(text) is None


def test_running_process_has_not_ended() -> None:
    assert not HERE.has_ended()
    assert not replace(HERE, pid=1, start=Path("/proc/1/stat").read_text().rpartition(")")[2].split()[19]).has_ended()


def test_killed_process_has_ended_before_and_after_it_is_reaped() -> None:
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    start = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[19]
    identity = replace(HERE, pid=process.pid, start=start)
    assert not identity.has_ended()
    process.kill()
    while not identity.has_ended():
        pass
    process.communicate()
    assert identity.has_ended()


def test_later_process_with_the_same_id_is_another_process() -> None:
    assert replace(HERE, start="1").has_ended()


def test_nothing_is_known_of_other_hosts_and_boots() -> None:
    assert not replace(HERE, host="elsewhere", start="1").has_ended()
    assert not replace(HERE, boot="00000000", start="1").has_ended()
