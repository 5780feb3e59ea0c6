"""Several nodes: `map3d work` processes and Dask workers with workspaces of their own share a catalogue in MongoDB and tiles and scene in S3."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from map3d.catalogue import State, Workspace
from tests.cli.test_tiles_outside_the_workspace import published
from tests.cli.towns import Run, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
distributed = pytest.importorskip("distributed", reason="install map3d[dask]")
pytestmark = [pytest.mark.whole, pytest.mark.endurance]

VIEWS = ("--res", "0.03", "--view", "0/45", "--view", "90/30", "--view", "180/45")


@contextmanager
def worker(folder: Path, catalogue: str) -> Iterator[subprocess.Popen[bytes]]:
    """Runs `map3d work --forever` in an empty workspace; ends it with SIGTERM."""
    environment = {**os.environ, "MAP3D_CATALOGUE": catalogue, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "map3d", "work", "--forever", "--workers", "1", "--workspace", str(folder)]
    folder.mkdir()
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(command, stdout=log, stderr=log, env=environment)
        try:
            yield process
        finally:
            process.terminate()
            process.wait(timeout=60)


def kill_when_it_renders(process: subprocess.Popen[bytes], workspace: Workspace, over: threading.Event) -> None:
    catalogue = workspace.open_catalogue()
    while not over.wait(0.01):
        if any(f".{process.pid}." in str(job.worker) for job in catalogue.jobs("view", state=State.LEASED)):
            os.kill(process.pid, signal.SIGKILL)
            break
    catalogue.close()


def test_nodes_give_the_published_folder_of_one_machine(
    run: Run, tmp_path: Path, s3_url: str, mongo_server: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, catalogue = write_town(tmp_path / "files"), f"{mongo_server}/nodes_{os.getpid()}_{time.monotonic_ns()}"
    one = Workspace(tmp_path / "one")
    for words in (("create-scene", "town"), ("add-files", "town", str(files)), ("create-rendering", "town", "view", *VIEWS), ("render", "view")):
        assert run(*words, "--workspace", str(one.root))[0] == 0
    expected = published(run, one, tmp_path / "published-one")

    monkeypatch.setenv("MAP3D_CATALOGUE", catalogue)
    planner = Workspace(tmp_path / "planner", catalogue)
    for words in (
        ("create-scene", "town", "--files", f"{s3_url}/scenes"),
        ("add-files", "town", str(files)),
        ("create-rendering", "town", "view", *VIEWS, "--tiles", f"{s3_url}/tiles"),
    ):
        status, _, err = run(*words, "--workspace", str(planner.root))
        assert status == 0, err
    with ExitStack() as stack:
        options = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0", "local_directory": tmp_path / "scratch"}
        cluster = stack.enter_context(distributed.LocalCluster(n_workers=2, threads_per_worker=1, **options))
        lost, kept = (stack.enter_context(worker(tmp_path / name, catalogue)) for name in ("lost", "kept"))
        over = threading.Event()
        killer = threading.Thread(target=kill_when_it_renders, args=(lost, planner, over))
        killer.start()
        options = ("--dask", cluster.scheduler_address, "--dask-workspace", str(tmp_path / "dask"), "--workspace", str(planner.root))
        status, _, err = run("render", "view", *options)
        over.set()
        killer.join()
        assert status == 0, err
        assert lost.poll() == -signal.SIGKILL, (tmp_path / "lost" / "log").read_text()
        assert kept.poll() is None, (tmp_path / "kept" / "log").read_text()
    assert kept.returncode == 0
    assert published(run, planner, tmp_path / "published-nodes") == expected
