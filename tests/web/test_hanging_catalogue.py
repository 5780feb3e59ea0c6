"""A database that hangs costs the requests that need it a few seconds, and delays no others."""

import asyncio
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from map3d.catalogue import SceneRecord, Workspace
from map3d.web import create_app
from map3d.web.http import shared_catalogue
from map3d.web.http.settings import ServerSettings
from map3d.web.server.views import THREADS
from tests.catalogue.mongo_process import MongoProcess


@pytest.fixture
def workspace(own_mongo_server: MongoProcess, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Workspace]:
    monkeypatch.setenv("MAP3D_CATALOGUE", f"{own_mongo_server.url}/town")
    monkeypatch.setattr(shared_catalogue, "WAIT_S", 2.0)
    home = Workspace(tmp_path / "workspace").create()
    with home.open_catalogue() as catalogue:
        catalogue.create_scene(SceneRecord("town"))
    yield home
    os.kill(own_mongo_server.pid, signal.SIGCONT)


@pytest.mark.parametrize("is_open", [True, False])
def test_requests_for_files_do_not_wait_for_the_catalogue(own_mongo_server: MongoProcess, workspace: Workspace, is_open: bool) -> None:
    """More requests than threads wait for the catalogue; files and the health check are answered before them."""

    async def ask() -> None:
        app = create_app(workspace, ServerSettings())
        async with httpx.AsyncClient(transport=httpx.ASGITransport(app=app), base_url="http://test", timeout=60) as client:
            if is_open:
                assert (await client.get("/renderings")).status_code == 200
            os.kill(own_mongo_server.pid, signal.SIGSTOP)
            waiting = [asyncio.create_task(client.get("/renderings")) for _ in range(2 * THREADS)]
            await asyncio.sleep(0)
            for path in ("/healthz", "/static/page.css", "/favicon.svg"):
                assert (await client.get(path)).status_code == 200
                assert not any(task.done() for task in waiting)
            assert "no answer" in (await client.get("/readyz")).json()["catalogue"]
            assert {answer.status_code for answer in await asyncio.gather(*waiting)} == {503}
            os.kill(own_mongo_server.pid, signal.SIGCONT)
            assert (await client.get("/renderings")).status_code == 200
        await app.close()

    asyncio.run(ask())
