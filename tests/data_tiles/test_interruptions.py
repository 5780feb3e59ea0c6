"""Data tiles of renderings that were stopped, stored elsewhere, or rendered on demand: the bytes of an undisturbed render."""

import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest

from map3d.catalogue import State, Workspace
from map3d.cli.app import run
from map3d.jobs.on_demand.worker import OnDemandSettings
from map3d.publish import publish
from map3d.publish.pmtiles_archive import Archive
from map3d.types import TileId
from map3d.web import create_app
from map3d.web.http.settings import ServerSettings
from tests.data_tiles.towns import KINDS, RES_M, VIEW, stored_tiles
from tests.web.conftest import Client

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

DEADLINE_S = 120


def create(workspace: Workspace, *options: str) -> None:
    assert run(["create-rendering", "town", "new", "--view", VIEW, "--res", RES_M, "--data", "tile", *options, "-w", str(workspace.root)]) == 0


def test_a_killed_render_resumes_and_ends_with_the_same_tiles(workspace: Workspace, rendered: Workspace) -> None:
    create(workspace)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "map3d", "render", "new", "--workers", "1", "-w", str(workspace.root)]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL)
    with closing(workspace.open_catalogue()) as catalogue:
        end = time.monotonic() + DEADLINE_S
        while catalogue.count_jobs("new")[State.DONE] < 1 and process.poll() is None:
            assert time.monotonic() < end
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
        process.wait()
        unfinished = catalogue.count_jobs("new")
        assert unfinished[State.DONE] < sum(unfinished.values()), "it was killed in between"
    with closing(workspace.open_catalogue(lease_s=0.1)) as catalogue, catalogue._database.transaction() as db:  # type: ignore[attr-defined]
        db.execute("UPDATE job SET expires = expires - 3600 WHERE state = 'leased'")
    assert run(["render", "new", "-w", str(workspace.root)]) == 0
    for layer in ("color", "data"):
        assert stored_tiles(workspace, "new", layer) == stored_tiles(rendered, "tile", layer)
    assert run(["verify", "-w", str(workspace.root)]) == 0


def test_data_tiles_in_an_object_store_are_rendered_served_and_published(
    workspace: Workspace, rendered: Workspace, store_url: str, tmp_path: Path
) -> None:
    create(workspace, "--tiles", f"{store_url}/tiles")
    assert run(["render", "new", "-w", str(workspace.root)]) == 0
    assert stored_tiles(workspace, "new", "data") == stored_tiles(rendered, "tile", "data")
    served = Client(create_app(workspace))
    for kind in KINDS:
        tile, data = next(iter(stored_tiles(rendered, "png", kind).items()))
        assert served.get(f"/tiles/new/{VIEW}/{kind}/{'/'.join(map(str, tile))}").content == data
    served.close()
    done = publish(workspace, "new", f"{store_url}/published")
    assert done.archives == 2
    publish(workspace, "new", tmp_path / "out")
    (archive,) = (tmp_path / "out" / VIEW).glob("data-*.pmtiles")
    assert {TileId(*zxy): data for zxy, data in Archive(archive).tiles()} == stored_tiles(rendered, "tile", "data")


def test_blocks_are_rendered_on_demand_for_layers_made_of_data_tiles(workspace: Workspace, rendered: Workspace) -> None:
    create(workspace)
    assert run(["render", "new", "--plan-only", "-w", str(workspace.root)]) == 0
    client = Client(create_app(workspace, ServerSettings(on_demand=OnDemandSettings())))
    try:
        pngs = {kind: stored_tiles(rendered, "png", kind) for kind in KINDS}
        deepest = max(tile.z for tile in pngs["id"])
        tile = next(tile for tile in pngs["id"] if tile.z == deepest)
        url = f"/tiles/new/{VIEW}/{{}}/{'/'.join(map(str, tile))}"
        end = time.monotonic() + DEADLINE_S
        while (response := client.get(url.format("id"))).status_code == 503 and time.monotonic() < end:
            time.sleep(0.5)
        assert (response.status_code, response.content) == (200, pngs["id"][tile])
        assert client.get(url.format("depth")).content == pngs["depth"][tile]
        assert client.get(url.format("data")).content == stored_tiles(rendered, "tile", "data")[tile]
        assert client.get(url.format("depth2")).status_code == 404
    finally:
        client.close()


def test_added_png_layers_precede_those_made_of_data_tiles(workspace: Workspace, rendered: Workspace) -> None:
    assert run(["add-layers", "tile", "--layers", "id", "-w", str(workspace.root)]) == 0
    assert run(["render", "tile", "-w", str(workspace.root)]) == 0
    expected = stored_tiles(rendered, "png", "id")
    assert stored_tiles(workspace, "tile", "id", f"{VIEW}+2") == expected
    client = Client(create_app(workspace))
    tile, data = next(iter(expected.items()))
    response = client.get(f"/tiles/tile/{VIEW}/id/{'/'.join(map(str, tile))}?v=2")
    assert (response.content, response.headers["cache-control"]) == (data, "public, max-age=31536000, immutable")
    client.close()
