"""Another process holds the write lock of the SQLite catalogue while a rendering is rendered."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
from map3d.catalogue import Workspace
from map3d.errors import StoreError
from map3d.jobs.events import JobDone, RunEvent
from map3d.jobs.run import Run, RunResult
from tests.jobs.stored import stored
from tests.jobs.test_work import CONTENT, SETTINGS, make_workspace, undisturbed
from tests.renderings.scenes import SquareScene


@contextmanager
def locked(workspace: Workspace) -> Iterator[sqlite3.Connection]:
    """Takes the lock that writers need; yields the connection that holds it."""
    connection = sqlite3.connect(workspace.root / "catalogue.sqlite", isolation_level=None, check_same_thread=False)
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield connection
    finally:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        connection.close()


def render(workspace: Workspace, on_event=lambda _: None) -> RunResult:
    catalogue = workspace.open_catalogue()
    try:
        run = Run(workspace, catalogue, "r", SETTINGS)
        return run.work(run.plan(scene=SquareScene(CONTENT)), on_event)
    finally:
        catalogue.close()


def test_render_waits_for_a_locked_catalogue(tmp_path: Path, faults: Path) -> None:
    """The lock is taken after the first block and freed a second later."""
    expected, workspace = undisturbed(tmp_path), make_workspace(tmp_path / "workspace")
    holders: list[threading.Thread] = []

    def hold() -> None:
        with locked(workspace):
            threading.Event().wait(1)

    def on_event(event: RunEvent) -> None:
        if isinstance(event, JobDone) and not holders:
            holders.append(threading.Thread(target=hold))
            holders[0].start()

    result = render(workspace, on_event)
    holders[0].join()
    assert (result.complete, result.statistics.failed_attempts) == (True, 0)
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected


def test_render_of_a_catalogue_that_stays_locked_ends_clearly_and_resumes(tmp_path: Path, faults: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected, workspace = undisturbed(tmp_path), make_workspace(tmp_path / "workspace")
    monkeypatch.setattr("map3d.database.BUSY_TIMEOUT_S", 0.2)
    with locked(workspace), pytest.raises(StoreError, match="locked"):
        render(workspace)
    assert render(workspace).complete
    assert (workspace.manifest_path("r").read_bytes(), stored(workspace)) == expected
