"""`map3d render --dask` gives the tiles of `map3d render`."""

import json
from pathlib import Path

import pytest

from map3d.catalogue import Workspace
from tests.cli.test_incremental import render_from_scratch
from tests.cli.test_whole import digest
from tests.cli.towns import Run, write_town

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
distributed = pytest.importorskip("distributed", reason="install map3d[dask]")
pytestmark = pytest.mark.whole


@pytest.mark.third_party
def test_dask_cluster_renders_the_same_tiles(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run("create-scene", "town")[0] == 0
    assert run("add-files", "town", str(write_town(tmp_path / "files")))[0] == 0
    assert run("create-rendering", "town", "view", "--res", "0.05", "--view", "0/45", "--data", "tile")[0] == 0
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0", local_directory=tmp_path / "scratch"
    ) as cluster:
        status, out, err = run("render", "view", "--dask", cluster.scheduler_address, "--json", "--stats")
    assert status == 0, err
    result = json.loads(out)
    assert result["complete"]
    assert result["stats"]["seconds"]["visibility"] > 0
    assert run("verify", "view")[0] == 0
    workspace = Workspace(tmp_path / "workspace")
    assert digest(workspace) == render_from_scratch(run, workspace, monkeypatch)


def test_missing_cluster_is_an_invalid_request(run: Run, tmp_path: Path) -> None:
    assert run("create-scene", "town")[0] == 0
    assert run("add-files", "town", str(write_town(tmp_path / "files", 1)))[0] == 0
    assert run("create-rendering", "town", "view", "--res", "0.1", "--view", "0/45")[0] == 0
    status, _, err = run("render", "view", "--dask", "nonsense://host")
    assert (status, "tcp://HOST:8786" in err) == (2, True)
