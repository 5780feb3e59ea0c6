"""Answers from memory do not pass the event loop, and are the same as those that do."""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator

import httpx
import pytest
from granian import _futures

from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId
from map3d.web.http import open_stores
from map3d.web.server.early_answers import answer_early
from map3d.web.server.metrics import Metrics
from map3d.web.server.observer import Observer
from tests.web.test_server import SCRIPT
from tests.web.workspaces import OCCUPIED, ZMAX, put_block, rendering_record, store_shape

TILE = f"/tiles/tea/0-45/color/{ZMAX}/7/7"
IMMUTABLE = TILE + "?v=1"
MANIFEST = "/tiles/tea/rendering.json"
HEADERS = [
    {},
    {"if-none-match": '"other"'},
    {"if-none-match": "*"},
    {"range": "bytes=0-3"},
    {"range": "bytes=900000-"},
    {"range": "bytes=0-3", "if-range": '"other"'},
    {"accept-encoding": "gzip"},
]
MARKED = (
    """
from map3d.web.server import asgi_app
from map3d.web.tiles import manifest_route
from map3d.web.http import open_stores
open_stores.RECHECK_S = manifest_route.RECHECK_S = 3600.0
inner = asgi_app.App.__call__
async def marked(self, scope, receive, send):
    async def send_marked(message):
        await send({**message, "headers": [*message["headers"], (b"x-loop", b"1")]} if message["type"].endswith("start") else message)
    await inner(self, scope, receive, send_marked if scope["type"] == "http" else send)
asgi_app.App.__call__ = marked
"""
    + SCRIPT
)
"""A server that marks the answers of its event loop, and never looks at stores again."""


@pytest.fixture
def never_recheck(monkeypatch) -> None:
    monkeypatch.setattr(open_stores, "RECHECK_S", 3600.0)
    monkeypatch.setattr("map3d.web.tiles.manifest_route.RECHECK_S", 3600.0)


@pytest.fixture(scope="module")
def marked(finished, tmp_path_factory) -> Iterator[httpx.Client]:
    script = tmp_path_factory.mktemp("marked") / "serve.py"
    script.write_text(MARKED)
    command = [sys.executable, str(script), str(finished.root), "1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    try:
        with httpx.Client(base_url=process.stdout.readline().strip(), timeout=60) as client:
            yield client
        process.send_signal(signal.SIGTERM)
        assert process.wait(60) == 0
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def scope_of(path: str, method: str = "GET", **headers: str) -> dict:
    plain, _, query = path.partition("?")
    listed = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    return {"type": "http", "method": method, "path": plain, "query_string": query.encode(), "headers": listed}


@pytest.mark.parametrize("headers", HEADERS, ids=[" ".join(one) + str(number) for number, one in enumerate(HEADERS)])
@pytest.mark.parametrize("method", ["GET", "HEAD"])
@pytest.mark.parametrize("path", [IMMUTABLE, MANIFEST])
def test_a_server_answers_the_second_request_early_and_equally(marked, path, method, headers):
    assert marked.get(path).status_code == 200
    early = marked.request(method, path, headers=headers)
    assert "x-loop" not in early.headers
    slow = marked.request(method, IMMUTABLE + "&x=1" if path == IMMUTABLE else "/view/tea/rendering.json", headers=headers)
    if path == IMMUTABLE:
        assert slow.headers.pop("x-loop") == "1", "a query of more than one value is not kept in memory"
    for one in (early, slow):
        one.headers.pop("date", None)
    assert (early.status_code, early.content, dict(early.headers)) == (slow.status_code, slow.content, dict(slow.headers))


def test_requests_on_one_connection_may_change_between_both_ways(marked):
    for _ in range(3):
        assert marked.get(IMMUTABLE).status_code == 200
        assert marked.get("/healthz").headers["x-loop"] == "1"
        assert marked.post(IMMUTABLE).status_code == 405
        assert marked.get(TILE).headers["x-loop"] == "1"


@pytest.mark.parametrize("path", [TILE, "/healthz", "/", "/tiles/none/rendering.json", IMMUTABLE + "&v=2", "/tiles/tea/0-45/color/4/7/99?v=1"])
def test_all_that_is_not_in_memory_is_left_to_the_event_loop(client, never_recheck, path):
    for _ in range(2):
        client.get(path)
        assert client.app.answer_early(scope_of(path)) is None


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
@pytest.mark.parametrize("path", [IMMUTABLE, MANIFEST])
def test_other_methods_are_left_to_the_event_loop(client, never_recheck, method, path):
    client.get(path)
    assert client.app.answer_early(scope_of(path)) is not None
    assert client.app.answer_early(scope_of(path, method)) is None


@pytest.mark.parametrize("path", [IMMUTABLE, MANIFEST])
def test_what_was_not_looked_at_lately_is_left_to_the_event_loop(client, monkeypatch, path):
    client.get(path)
    monkeypatch.setattr(open_stores, "RECHECK_S", 0.0)
    monkeypatch.setattr("map3d.web.tiles.manifest_route.RECHECK_S", 0.0)
    assert client.app.answer_early(scope_of(path)) is None


def test_a_replaced_block_is_not_answered_from_memory(client, workspace, monkeypatch):
    monkeypatch.setattr(open_stores, "RECHECK_S", 0.0)
    before = client.get(IMMUTABLE).content
    path = workspace.store_path("tea", "0-45")
    path.unlink()
    with SqliteTileStore.create(path, store_shape(rendering_record())) as store:
        for x in (0, 1):
            for y in (0, 1):
                put_block(store, "0-45", BlockId(1, x, y), Occupancy.from_tiles(ZMAX, OCCUPIED), version=1, salt="new")
    assert client.get(IMMUTABLE).content != before
    monkeypatch.setattr(open_stores, "RECHECK_S", 3600.0)
    assert client.app.answer_early(scope_of(IMMUTABLE))[1]["body"] == client.get(IMMUTABLE).content != before


def test_early_answers_are_counted(client, never_recheck):
    metrics = Metrics()
    client.app.observer = Observer(metrics, access_log=False, proxies=())
    client.get(IMMUTABLE)
    hits = client.app.tiles.cache_hits
    counted = list(metrics.values)
    assert client.app.answer_early(scope_of(IMMUTABLE)) is not None
    changed = {number for number, (old, new) in enumerate(zip(counted, metrics.values, strict=True)) if old != new}
    assert metrics.values[1] == counted[1] + 1, "a tile, 2xx"
    assert len(changed) == 3, "also its seconds and their bucket"
    assert client.app.tiles.cache_hits == hits + 1


def test_with_a_log_all_requests_pass_the_event_loop(client, never_recheck):
    client.app.observer = Observer(None, access_log=True, proxies=())
    client.get(IMMUTABLE)
    assert client.app.answer_early(scope_of(IMMUTABLE)) is None


class Request:
    """A request as granian hands it over."""

    def __init__(self, scope: dict) -> None:
        self.scope, self.proto, self.sent, self.ended = scope, self, [], 0

    def send(self, message: dict) -> None:
        self.sent.append(message)

    def done(self) -> None:
        self.ended += 1


@pytest.fixture
def scheduled(monkeypatch) -> Iterator[Callable[[Request], list]]:
    """Hands a request over; returns those that reached the event loop."""
    monkeypatch.setattr(_futures, "_cbsched_aioschedule", lambda _loop, _context, callback: callback)
    answer_early(lambda scope: ({"type": "start"}, {"type": "body"}) if scope["path"] == "/known" else None)
    loop, reached = asyncio.new_event_loop(), []
    schedule = _futures._cbsched_aioschedule(loop, None, reached.append)

    def hand_over(request: Request) -> list:
        schedule(request)
        return reached

    yield hand_over
    loop.close()


@pytest.mark.parametrize("scope", [{"type": "http", "path": "/other"}, {"type": "websocket", "path": "/known"}])
def test_a_request_without_an_early_answer_reaches_the_event_loop(scheduled, scope):
    request = Request(scope)
    assert scheduled(request) == [request]
    assert (request.sent, request.ended) == ([], 0)


def test_an_early_answer_ends_its_request(scheduled):
    request = Request({"type": "http", "path": "/known"})
    assert scheduled(request) == []
    assert ([message["type"] for message in request.sent], request.ended) == (["start", "body"], 1)


def test_a_granian_without_the_hook_serves_without_early_answers(monkeypatch, caplog):
    monkeypatch.delattr(_futures, "_cbsched_aioschedule")
    answer_early(lambda _scope: None)
    assert not hasattr(_futures, "_cbsched_aioschedule")
    assert "granian has no _cbsched_aioschedule" in caplog.text
