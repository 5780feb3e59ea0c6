"""Tiles that are rendered when they are asked for: what is served, when, and how often it is rendered."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import httpx
import pytest

from map3d.catalogue import State
from map3d.jobs.on_demand.worker import OnDemandSettings
from map3d.tiles.occupancy import Occupancy
from map3d.types import BlockId
from map3d.web import create_app
from map3d.web.http.settings import ServerSettings
from map3d.web.tiles import tile_route
from tests.jobs.conftest import faults as faults
from tests.jobs.conftest import town as town
from tests.jobs.town import ENTRY, TIMEOUTS, VIEW, Town, planned_jobs
from tests.web.conftest import Client
from tests.web.workspaces import manifest_of

SETTINGS = OnDemandSettings(timeouts=replace(TIMEOUTS, block_s=20.0), entry=ENTRY)
IMMUTABLE = "public, max-age=31536000, immutable"
NOTICED_S = 60
"""Limit for a change that the server finds by itself."""

SCRIPT = """
import sys
from functools import partial
from pathlib import Path
from map3d.web import serve
from map3d.web.http.settings import ServerSettings
from tests.web.test_on_demand import SETTINGS
if __name__ == "__main__":
    serve(Path(sys.argv[1]), port=0, workers=2, settings=ServerSettings(on_demand=SETTINGS), on_ready=partial(print, flush=True))
"""


def url(town: Town, x: int, y: int = 0, version: int | None = 1, layer: str = "color") -> str:
    """Returns the URL of the first base tile of a block."""
    return f"/tiles/town-a/{VIEW}/{layer}/{town.rendering.zmax}/{8 * x}/{8 * y}" + ("" if version is None else f"?v={version}")


@contextmanager
def serving(town: Town, settings: OnDemandSettings | None = SETTINGS) -> Iterator[Client]:
    client = Client(create_app(town.workspace, ServerSettings(on_demand=settings)))
    try:
        yield client
    finally:
        client.close()


@pytest.fixture
def client(town: Town) -> Iterator[Client]:
    with serving(town) as opened:
        yield opened


def rendered(faults: Path) -> int:
    return len((faults / "log").read_text().splitlines())


def test_a_missing_tile_is_rendered_and_served_as_immutable(town: Town, client: Client) -> None:
    response = client.get(url(town, 1))
    assert (response.status_code, response.headers["cache-control"]) == (200, IMMUTABLE)
    assert response.headers["content-type"] == "image/webp"
    again = client.get(url(town, 1))
    assert (again.status_code, again.content, again.headers["etag"]) == (200, response.content, response.headers["etag"])
    assert client.get(url(town, 1, layer="id")).status_code == 200
    assert town.count(State.DONE) == 1


def test_an_empty_tile_is_rendered_too(town: Town, client: Client) -> None:
    response = client.get(url(town, 6))
    assert (response.status_code, response.headers["cache-control"]) == (204, IMMUTABLE)


def test_without_on_demand_nothing_is_rendered(town: Town) -> None:
    with serving(town, None) as client:
        assert client.get(url(town, 1)).status_code == 404
    assert town.count(State.DONE) == 0


def test_the_overview_has_all_blocks_below_rendered(town: Town, client: Client) -> None:
    assert client.get(f"/tiles/town-a/{VIEW}/color/0/0/0?v=1").status_code == 200
    assert town.count(State.DONE) == len(planned_jobs(town.rendering))


@pytest.mark.parametrize("path", ["9/0/0", "6/99/0", "6/-1/0", "06/0/0"])
def test_a_tile_that_cannot_exist_is_refused(town: Town, client: Client, path: str) -> None:
    response = client.get(f"/tiles/town-a/{VIEW}/color/{path}")
    assert (response.status_code, response.headers["cache-control"]) == (404, "no-store")
    assert town.count(State.LEASED) == 0


def test_the_list_of_renderings_has_nothing_rendered(town: Town, client: Client) -> None:
    """Its pictures are made of the tiles that are stored; those of a rendering without tiles are missing."""
    record = town.rendering
    occupancy = Occupancy.from_tiles(record.zmax, [(0, 0)])
    manifest = manifest_of(record, occupancy, 1)
    town.workspace.manifest_path(record.name).parent.mkdir(parents=True, exist_ok=True)
    town.workspace.manifest_path(record.name).write_bytes(manifest.dump())
    page = client.get("/renderings").text
    addresses = re.findall('(?:src|href)="([^"]*(?:tiles|preview)[^"]*)"', page)
    assert addresses == [f"view/{record.name}/preview.jpg"]
    assert client.get("/" + addresses[0]).status_code == 404
    assert (town.count(State.DONE), town.count(State.LEASED)) == (0, 0)


def test_a_stale_tile_is_served_while_its_block_is_rendered_anew(town: Town, client: Client, faults: Path) -> None:
    old = client.get(url(town, 1))
    town.catalogue.announce("town-a", 1)
    (faults / "salt").write_text("new")
    (faults / "slow").write_text("0.5")
    town.catalogue.plan("town-a", planned_jobs(town.rendering, "changed"))
    assert client.app.on_demand is not None
    client.app.on_demand._refresh()
    stale = client.get(url(town, 1))
    assert (stale.status_code, stale.headers["cache-control"], stale.content) == (200, "no-cache", old.content)
    demand = client.app.on_demand.requests.find(("town-a", VIEW, BlockId(town.rendering.zmax - 3, 1, 0)))
    if demand is not None:
        demand.ended.result(60)
    fresh = client.get(url(town, 1, version=2))
    assert (fresh.status_code, fresh.headers["cache-control"]) == (200, IMMUTABLE)
    assert fresh.content != old.content
    assert client.get(url(town, 1)).headers["cache-control"] == "no-cache", "version 1 is gone"


def test_a_plan_is_noticed_without_help(town: Town, client: Client, faults: Path) -> None:
    old = client.get(url(town, 1))
    town.catalogue.announce("town-a", 1)
    (faults / "salt").write_text("new")
    town.catalogue.plan("town-a", planned_jobs(town.rendering, "changed"))
    deadline = time.monotonic() + NOTICED_S
    while client.get(url(town, 1)).content == old.content:
        assert time.monotonic() < deadline, "the old tile is still served"
        time.sleep(0.02)


def test_a_block_that_takes_long_is_503_and_rendered_nevertheless(town: Town, client: Client, faults: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (faults / "slow").write_text("1")
    monkeypatch.setattr(tile_route, "WAIT_S", 0.05)
    response = client.get(url(town, 1))
    assert (response.status_code, response.headers["cache-control"], response.headers["retry-after"]) == (503, "no-store", "5")
    monkeypatch.setattr(tile_route, "WAIT_S", 60.0)
    assert client.get(url(town, 1)).status_code == 200


def test_a_full_queue_is_503(town: Town, faults: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (faults / "slow").write_text("0.5")
    monkeypatch.setattr(tile_route, "WAIT_S", 0.05)
    with serving(town, replace(SETTINGS, queue=2)) as client:
        texts = [client.get(url(town, x)).text for x in range(3)]
        assert "is being rendered" in texts[0]
        assert "2 blocks are waiting" in texts[2]
        assert client.get(url(town, 3)).headers["retry-after"] == "5"


def test_too_many_blocks_are_503(town: Town) -> None:
    with serving(town, replace(SETTINGS, most_blocks=63)) as client:
        response = client.get(f"/tiles/town-a/{VIEW}/color/0/0/0")
        assert (response.status_code, response.headers["cache-control"], response.headers["retry-after"]) == (503, "no-store", "60")
        assert "map3d render town-a" in response.text


def test_an_error_is_never_cached(town: Town, client: Client, faults: Path) -> None:
    block = f"{town.rendering.zmax - 3}-2-0"
    (faults / block).write_text("exception")
    response = client.get(url(town, 2))
    assert (response.status_code, response.headers["cache-control"]) == (503, "no-store")
    assert "map3d jobs retry town-a" in response.text
    (faults / block).unlink()
    town.catalogue.retry("town-a")
    assert client.get(url(town, 2)).status_code == 200


def test_a_block_that_is_evicted_while_it_is_served_is_rendered_again(town: Town, faults: Path) -> None:
    (faults / "log").touch()
    with serving(town, replace(SETTINGS, quota_bytes=120_000)) as client:
        first = {x: client.get(url(town, x)).content for x in range(6)}
        assert client.app.on_demand is not None
        assert client.app.on_demand.cache.evicted > 0
        assert client.app.on_demand.cache.used_bytes() <= 120_000
        client.app.tiles.cache.clear()
        assert {x: client.get(url(town, x)).content for x in range(6)} == first
    assert rendered(faults) > 6


def test_hundred_requests_at_two_processes_render_a_block_once(town: Town, faults: Path, tmp_path: Path) -> None:
    (faults / "log").touch()
    (faults / "slow").write_text("0.5")
    script = tmp_path / "serve.py"
    script.write_text(SCRIPT)
    path = os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])
    command = [sys.executable, str(script), str(town.workspace.root)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": path})
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        with ThreadPoolExecutor(100) as threads:
            answers = list(threads.map(lambda n: httpx.get(address + url(town, 1)[1:], timeout=60, headers={"connection": "close"}), range(100)))
        assert {(answer.status_code, answer.headers["etag"]) for answer in answers} == {(200, answers[0].headers["etag"])}
        assert rendered(faults) == 1
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
