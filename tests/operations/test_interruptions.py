"""Operations that are killed, cancelled or crash: a second worker finishes them, with the bytes of an undisturbed run."""

import os
import shutil
import signal
import subprocess
import threading
from pathlib import Path
from typing import Any

import pytest

from map3d.catalogue import OperationRecord, OperationState, State
from map3d.errors import StoreError
from map3d.messages import message
from tests.cli.towns import write_town
from tests.operations.scenario import (
    Scenario,
    files_below,
    is_running,
    kill,
    open_scenario,
    published,
    run_all,
    start_worker,
    wait_for,
)

POINTS = {
    "unpacking town.zip@2": "import",
    "importing house-2.obj": "import",
    "importing textured.obj": "import",
    "building": "build",
    "planning": "render",
    "rendering@1": "render",
    "publishing tiles@1": "publish",
    "publishing tiles@40": "publish",
}


def pause_at(point: str, scenario: Scenario, reached: Path, monkeypatch: pytest.MonkeyPatch) -> subprocess.Popen[bytes]:
    """Starts a worker and returns once the subprocess of its operation pauses at the point."""
    monkeypatch.setenv("MAP3D_TEST_POINT", point)
    reached.unlink(missing_ok=True)
    worker = start_worker(scenario)
    unended = (OperationState.WAITING, OperationState.RUNNING)
    wait_for(lambda: reached.exists() or worker.poll() is not None or not scenario.catalogue.operations(states=unended), point)
    assert reached.exists(), f"the worker reaches {point}: {scenario.catalogue.operations()}"
    return worker


@pytest.mark.parametrize("point", POINTS)
def test_operation_of_a_killed_worker_is_finished_by_another(
    point: str, scenario: Scenario, archive: Path, undisturbed: dict[str, bytes], reached: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed = []

    def interrupt(operation: OperationRecord) -> None:
        if operation.kind == POINTS[point]:
            kill(pause_at(point, scenario, reached, monkeypatch))
            wait_for(lambda: not is_running(int(reached.read_text())), "the end of the killed worker's subprocess")
            assert scenario.catalogue.operation(operation.id).state is OperationState.RUNNING
            killed.append(operation.id)

    run_all(scenario, archive, interrupt)
    assert len(killed) == 1
    assert published(scenario) == undisturbed
    assert not list((scenario.workspace.root / "uploads").iterdir()), "imported uploads are removed"


@pytest.mark.parametrize("point", ["importing house-2.obj", "building", "rendering@1", "publishing tiles@1"])
def test_cancelled_operation_stops_and_a_retry_resumes(
    point: str, scenario: Scenario, archive: Path, undisturbed: dict[str, bytes], reached: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cancelled = []

    def interrupt(operation: OperationRecord) -> None:
        if operation.kind != POINTS[point]:
            return
        worker = pause_at(point, scenario, reached, monkeypatch)
        assert scenario.catalogue.cancel_operation(operation.id).cancelling
        wait_for(lambda: scenario.catalogue.operation(operation.id).state is OperationState.CANCELLED, "the end of the operation")
        assert not is_running(int(reached.read_text()))
        said = str(scenario.catalogue.operation(operation.id).message)
        assert said.startswith(f"cancelled while {point.partition('@')[0]}")
        if operation.kind == "render":
            assert scenario.catalogue.count_jobs("town")[State.LEASED] == 0
        assert not list((scenario.workspace.root / "uploads").glob(".operation-*"))
        kill(worker)
        scenario.catalogue.retry_operation(operation.id)
        cancelled.append(operation.id)

    run_all(scenario, archive, interrupt)
    assert len(cancelled) == 1
    assert published(scenario) == undisturbed


@pytest.mark.parametrize("what", ["scene", "rendering"])
def test_killed_removal_is_completed(
    what: str, tmp_path: Path, archive: Path, scenario: Scenario, reached: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_all(scenario, archive)
    scenario.catalogue.close()
    left = []
    for name in ("whole", "killed"):
        shutil.copytree(scenario.workspace.root, tmp_path / name)
        copied = open_scenario(tmp_path / name)
        asked = copied.ask("remove", what=what, folders=["town"], **({"with_renderings": True} if what == "scene" else {}))
        if name == "killed":
            kill(pause_at("remove_folder", copied, reached, monkeypatch))
            assert files_below(copied.workspace.root) != left[0]
        copied.work()
        assert copied.catalogue.operation(asked.id).state is OperationState.DONE
        assert copied.catalogue.renderings() == []
        assert len(copied.catalogue.scenes()) == (what == "rendering")
        left.append(files_below(copied.workspace.root))
        copied.catalogue.close()
    assert left[0] == left[1]


def test_crash_costs_the_operation_alone(scenario: Scenario, archive: Path, reached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAP3D_TEST_CRASH", "1")
    crashing = scenario.ask("import", files=[scenario.upload(archive)])
    worker = pause_at("importing house-2.obj", scenario, reached, monkeypatch)
    wait_for(lambda: scenario.catalogue.operation(crashing.id).state is OperationState.FAILED, "the end of the operation")
    assert "SIGSEGV" in str(scenario.catalogue.operation(crashing.id).message)
    assert worker.poll() is None, "the worker continues"
    kill(worker)
    scenario.catalogue.retry_operation(crashing.id)
    scenario.work()
    assert scenario.catalogue.operation(crashing.id).state is OperationState.DONE


def test_stopped_worker_releases_its_operation(scenario: Scenario, archive: Path, reached: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = scenario.ask("import", files=[scenario.upload(archive)])
    worker = pause_at("importing house-2.obj", scenario, reached, monkeypatch)
    worker.send_signal(signal.SIGTERM)
    assert worker.wait(120) == 0
    assert scenario.catalogue.operation(asked.id).state is OperationState.WAITING
    assert not is_running(int(reached.read_text()))
    scenario.work()
    assert scenario.catalogue.operation(asked.id).state is OperationState.DONE


def test_progress_and_log_are_seen_while_the_operation_runs(
    scenario: Scenario, archive: Path, reached: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = scenario.ask("import", files=[scenario.upload(archive)])
    worker = pause_at("importing house-2.obj", scenario, reached, monkeypatch)
    wait_for(lambda: str(scenario.catalogue.operation(asked.id).stage).startswith("importing house-2.obj"), "the progress")
    running = scenario.catalogue.operation(asked.id)
    assert (running.state, running.done, running.total) == (OperationState.RUNNING, 1, 4)
    assert running.worker is not None
    assert f".{worker.pid}." in running.worker
    assert os.getpid() != worker.pid
    kill(worker)


def test_operation_that_waits_behind_one_of_another_worker_is_done(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    first, second = (scenario.ask("import", files=[scenario.upload(path, name)]) for name in ("a.obj", "b.obj"))
    lease = scenario.catalogue.lease_operation("elsewhere.00000000.1.1/0")
    assert lease is not None
    assert lease.operation.id == first.id
    ending = threading.Timer(1.0, lambda: scenario.catalogue.end_operation(lease, OperationState.DONE, message("imported", files=1, unchanged=0)))
    ending.start()
    scenario.work()
    ending.join()
    assert scenario.catalogue.operation(second.id).state is OperationState.DONE


def test_operation_whose_end_could_not_be_stored_is_done_again(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    first, second = (scenario.ask("import", files=[scenario.upload(path, name)]) for name in ("a.obj", "b.obj"))
    original, failures = type(scenario.catalogue).end_operation, [StoreError("database is locked")]

    def end(*arguments: Any) -> None:
        if failures:
            raise failures.pop()
        original(*arguments)

    monkeypatch.setattr(type(scenario.catalogue), "end_operation", end)
    scenario.work()
    assert failures == []
    assert [scenario.catalogue.operation(one.id).state for one in (first, second)] == [OperationState.DONE] * 2
