"""Operations in MongoDB: kills between any two requests, and processes that compete for the same operations."""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import pytest

from map3d.catalogue import Catalogue, OperationLease, OperationState, SceneRecord, open_catalogue
from map3d.catalogue.mongodb_connection import MongoConnection
from map3d.errors import BadRequest, StaleFence
from map3d.messages import verbatim
from tests.catalogue.implementations import Kill, NewUrl, new_urls

LEASE_S = 0.3


def _leased(catalogue: Catalogue, lease: OperationLease) -> None:
    catalogue.lease_operation("w")


def _logged(catalogue: Catalogue, lease: OperationLease) -> None:
    catalogue.append_log(lease, [verbatim("a"), verbatim("b")])


def _progressed(catalogue: Catalogue, lease: OperationLease) -> None:
    catalogue.heartbeat_operation(lease, verbatim("building"), 1, 2)


def _ended(catalogue: Catalogue, lease: OperationLease) -> None:
    catalogue.end_operation(lease, OperationState.DONE)


def _released(catalogue: Catalogue, lease: OperationLease) -> None:
    with suppress(StaleFence):
        catalogue.release_operation(lease)


def _cancelled(catalogue: Catalogue, lease: OperationLease) -> None:
    catalogue.cancel_operation(lease.operation.id)


def _expired(catalogue: Catalogue, lease: OperationLease) -> None:
    catalogue.expire_operations(["w"])


def _retried(catalogue: Catalogue, lease: OperationLease) -> None:
    with suppress(StaleFence):
        catalogue.end_operation(lease, OperationState.FAILED)
    with suppress(BadRequest):
        catalogue.retry_operation(lease.operation.id)


@pytest.mark.parametrize("change", [_leased, _logged, _progressed, _ended, _released, _cancelled, _expired, _retried])
@pytest.mark.parametrize("executed", [False, True], ids=["before", "after"])
def test_change_killed_before_or_after_any_request_can_be_repeated(
    new_url: NewUrl, monkeypatch: pytest.MonkeyPatch, change: Callable[[Catalogue, OperationLease], None], executed: bool
) -> None:
    """Afterwards a worker ends every operation of the scene, one after another."""
    number, kill = 0, Kill(0, executed)
    while number == 0 or kill.happened:
        catalogue, lease = with_operations(new_url())
        kill = Kill(number, executed)
        with monkeypatch.context() as patched, suppress(KeyboardInterrupt):
            patched.setattr(MongoConnection, "run", kill.run)
            change(catalogue, lease)
        change(catalogue, lease)
        work_off(catalogue)
        expected = OperationState.CANCELLED if change is _cancelled else OperationState.DONE
        states = [item.state for item in catalogue.operations()]
        assert states == [OperationState.DONE, expected], f"killed at request {number}"
        assert [str(line.text) for line in catalogue.operation_log(lease.operation.id)][-2:] in ([], ["a", "b"])
        catalogue.close()
        number += 1
    assert number > 2, "there were requests to kill"


@pytest.fixture
def new_url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[NewUrl]:
    with new_urls("mongodb", request, tmp_path) as new:
        yield new


def with_operations(url: str) -> tuple[Catalogue, OperationLease]:
    """Returns a catalogue with a running and a waiting operation of one scene, and the lease of the first."""
    catalogue = open_catalogue(url, lease_s=LEASE_S)
    catalogue.create_scene(SceneRecord("town"))
    for _ in range(2):
        catalogue.create_operation("build", "town", {}, "anna")
    lease = catalogue.lease_operation("w")
    assert lease is not None
    return catalogue, lease


def work_off(catalogue: Catalogue) -> None:
    """Ends all operations as a worker would that starts after the others were killed."""
    unended = (OperationState.WAITING, OperationState.RUNNING)
    deadline = time.monotonic() + 60
    while catalogue.operations(states=unended):
        assert time.monotonic() < deadline, "every lease of a killed worker expires"
        lease = catalogue.lease_operation("last")
        if lease is not None:
            assert [item.id for item in catalogue.operations(states=[OperationState.RUNNING])] == [lease.operation.id]
            with suppress(StaleFence):
                catalogue.end_operation(lease, OperationState.DONE)


TAKE_ALL = """
import json, sys, time
from map3d.catalogue import OperationState, open_catalogue
from map3d.messages import verbatim

catalogue = open_catalogue(sys.argv[1])
spans = []
while catalogue.operations(states=["waiting"], limit=1):
    if (lease := catalogue.lease_operation(sys.argv[2])) is not None:
        began = time.monotonic_ns()
        assert catalogue.heartbeat_operation(lease, verbatim("s"), 0, 1)
        ended = time.monotonic_ns()
        catalogue.end_operation(lease, OperationState.DONE)
        spans.append([lease.operation.scene, lease.operation.id, began, ended])
catalogue.close()
print(json.dumps(spans))
"""


@pytest.mark.parametrize("implementation", ["mongodb", "sqlite"])
def test_processes_never_run_two_operations_of_one_scene_at_once(implementation: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    with new_urls(implementation, request, tmp_path) as new:
        url = new()
        catalogue = open_catalogue(url)
        for scene in ("a", "b"):
            catalogue.create_scene(SceneRecord(scene))
        ids = [catalogue.create_operation("build", "ab"[number % 3 == 0], {}, "anna").id for number in range(30)]
        command = [sys.executable, "-c", TAKE_ALL, url]
        started = [subprocess.Popen([*command, f"w{n}"], stdout=subprocess.PIPE, text=True) for n in range(3)]
        spans = [tuple(span) for process in started for span in json.loads(process.communicate(timeout=120)[0])]
        assert sorted(span[1] for span in spans) == sorted(ids), "each ran once"
        for scene in "ab":
            times = sorted((began, ended) for name, _, began, ended in spans if name == scene)
            assert all(before[1] <= after[0] for before, after in pairwise(times))
        catalogue.close()
