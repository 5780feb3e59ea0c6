"""From a file to a published folder by many nodes: MongoDB, S3, a Dask cluster and two `map3d work` processes, of which one is killed."""

import hashlib
import os
import shutil
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
from map3d.catalogue import State, Workspace
from tests.object_servers import environment

pytest.importorskip("pymongo", reason="install map3d[mongodb]")
distributed = pytest.importorskip("distributed", reason="install map3d[dask]")
pytestmark = pytest.mark.whole
COMMAND_S = 300


def map3d(*arguments: str | Path) -> str:
    done = subprocess.run([sys.executable, "-m", "map3d", *map(str, arguments)], capture_output=True, text=True, timeout=COMMAND_S, check=False)
    assert done.returncode == 0, f"{arguments}: {done.stdout}{done.stderr}"
    return done.stdout


def published(town: Path, workspace: Path, out: Path, *, shared: str = "", tiles: str = "", render: tuple[str, ...] = ()) -> dict[str, str]:
    """Imports, renders and publishes the town; returns the digest of every published file."""
    where = ("-w", workspace)
    map3d("create-scene", "town", *(("--files", shared) if shared else ()), *where)
    map3d("add-files", "town", town, *where)
    map3d("create-rendering", "town", "r", "--directions", "2", "--res", "0.04", *(("--tiles", tiles) if tiles else ()), *where)
    map3d("render", "r", *render, *where)
    map3d("verify", *where)
    map3d("publish", "r", "-o", out, *where)
    return {path.relative_to(out).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in out.rglob("*") if path.is_file()}


@contextmanager
def work_processes(folders: list[Path]) -> Iterator[list["subprocess.Popen[bytes]"]]:
    """Starts a `map3d work` for each folder, its own empty workspace."""
    command = [sys.executable, "-m", "map3d", "work", "--workers", "1", "--forever", "-w"]
    processes = [subprocess.Popen([*command, str(folder)], stdout=subprocess.DEVNULL) for folder in folders]
    try:
        yield processes
    finally:
        for process in processes:
            process.terminate()
            process.wait(COMMAND_S)


def kill_one_with_a_lease(
    catalogue_url: str, workspace: Path, processes: list["subprocess.Popen[bytes]"], command: "subprocess.Popen[bytes]"
) -> bool:
    """Kills the first of the processes that holds a lease; returns False when the command ended before."""
    catalogue = Workspace(workspace, catalogue_url).open_catalogue()
    try:
        while command.poll() is None:
            if any(record.name == "r" for record in catalogue.renderings()):
                for job in catalogue.jobs("r", state=State.LEASED):
                    for process in processes:
                        if f".{process.pid}." in str(job.worker):
                            process.kill()
                            process.wait()
                            return True
            time.sleep(0.02)
        return False
    finally:
        catalogue.close()


def test_killed_node_among_many_leaves_the_published_folder_of_one_machine(tmp_path: Path, mongo_server: str, s3_url: str) -> None:
    town, catalogue_url = tmp_path / "town", f"{mongo_server}/nodes{uuid.uuid4().hex[:8]}"
    map3d("make-town", "-o", town, "--buildings", "20", "--no-terrain")
    alone = published(town, tmp_path / "alone", tmp_path / "alone-site")
    shutil.rmtree(tmp_path / "alone")
    with environment({**os.environ, "MAP3D_CATALOGUE": catalogue_url}):
        many = many_nodes(town, tmp_path, catalogue_url, s3_url)
    assert many == alone


def many_nodes(town: Path, folder: Path, catalogue_url: str, s3_url: str) -> dict[str, str]:
    """Renders with a Dask cluster of two workers and two other processes; returns the digests of the published files."""
    nodes, workspace, out = [folder / "node0", folder / "node1"], folder / "many", folder / "many-site"
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as cluster,
        work_processes(nodes) as processes,
    ):
        options: dict[str, Any] = {"shared": f"{s3_url}/scenes", "tiles": f"{s3_url}/tiles", "render": ("--dask", cluster.scheduler_address)}
        script = (
            f"from tests.jobs.test_many_nodes import *; published(Path({str(town)!r}), Path({str(workspace)!r}), Path({str(out)!r}), **{options!r})"
        )
        whole = subprocess.Popen([sys.executable, "-c", script])
        killed = kill_one_with_a_lease(catalogue_url, workspace, processes, whole)
        assert whole.wait(COMMAND_S) == 0
        assert killed, "the render ended before a node held a lease; choose a larger town"
    return {path.relative_to(out).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in out.rglob("*") if path.is_file()}
