"""The operation worker beside a server: does operations, is started again when it ends by itself, and ends with the server."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from map3d.catalogue import OperationState
from map3d.operations import worker_process
from map3d.operations.worker_process import WorkerProcess, is_worker_alive
from tests.cli.towns import write_town
from tests.operations.scenario import Scenario, is_running, wait_for


def test_operations_are_done_while_the_context_lasts(scenario: Scenario, tmp_path: Path) -> None:
    path = next(write_town(tmp_path / "town", 1).iterdir())
    with WorkerProcess(scenario.workspace.root) as worker:
        asked = scenario.ask("import", files=[scenario.upload(path)])
        wait_for(lambda: scenario.catalogue.operation(asked.id).state is OperationState.DONE, "the import")
        pid = worker.pid
        assert pid is not None
    assert not is_running(pid)


def test_worker_that_is_killed_is_started_again(scenario: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_process, "PAUSES_S", (0.05, 0.05))
    path = next(write_town(tmp_path / "town", 1).iterdir())
    with WorkerProcess(scenario.workspace.root) as worker:
        wait_for(lambda: worker.pid is not None, "the first worker")
        first = worker.pid
        assert first is not None
        os.kill(first, signal.SIGKILL)
        wait_for(lambda: worker.pid != first, "the second worker")
        asked = scenario.ask("import", files=[scenario.upload(path)])
        wait_for(lambda: scenario.catalogue.operation(asked.id).state is OperationState.DONE, "the import")


def test_whether_a_worker_runs_is_known_from_its_file(scenario: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker_process, "PAUSES_S", (600.0, 600.0))
    with WorkerProcess(scenario.workspace.root) as worker:
        wait_for(lambda: is_worker_alive(worker.identity_path), "the worker")
        assert worker.pid is not None
        os.kill(worker.pid, signal.SIGKILL)
        wait_for(lambda: not is_worker_alive(worker.identity_path), "the end of the worker")
    assert not worker.identity_path.parent.exists()
    assert not is_worker_alive(worker.identity_path)


SERVER = """
import sys, time
from pathlib import Path
from map3d.operations.worker_process import WorkerProcess

with WorkerProcess(Path(sys.argv[1])) as worker:
    while worker.pid is None:
        time.sleep(0.01)
    print(worker.pid, flush=True)
    time.sleep(600)
"""


def test_worker_of_a_killed_server_ends(scenario: Scenario, tmp_path: Path) -> None:
    # A killed server cannot remove its temporary folder.
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    server = subprocess.Popen([sys.executable, "-c", SERVER, str(scenario.workspace.root)], stdout=subprocess.PIPE, text=True, env=environment)
    with server:
        assert server.stdout is not None
        pid = int(server.stdout.readline())
        assert is_running(pid)
        server.kill()
    wait_for(lambda: not is_running(pid), "the end of the worker")
