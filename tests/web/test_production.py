"""What an operator relies on: readiness, metrics, logs, reload and drain."""

import json
import logging
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import httpx
import pytest

from map3d.web import create_app
from map3d.web.http import health
from map3d.web.http.settings import ServerSettings
from map3d.web.server import health_route
from map3d.web.server.logs import TextFormatter
from map3d.web.server.metrics import COUNTERS, ROUTES, Metrics, render_metrics
from map3d.web.server.serve import find_port
from tests.web.conftest import Client

ROOT = Path(__file__).parents[2]
TILE = "/tiles/tea/0-45/color/4/7/7?v=1"
WAIT_S = 60.0


class Server:
    """`map3d serve` as a process."""

    def __init__(self, workspace: Path, *options: str, environment: dict[str, str] | None = None, worker: bool = False) -> None:
        command = [sys.executable, "-m", "map3d", "serve", "-w", str(workspace), "--port", "0", *(() if worker else ("--no-worker",)), *options]
        path = os.pathsep.join([str(ROOT), *sys.path])
        variables = {**os.environ, "PYTHONPATH": path, "PYTHONUNBUFFERED": "1", **(environment or {})}
        self.errors = workspace.parent / "errors.log"
        with self.errors.open("w") as errors:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True, env=variables)
        assert self.process.stdout is not None
        found = re.search(r"http://[^\s/]+", self.process.stdout.readline())
        assert found, self.errors.read_text()
        self.address = found[0]

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    def close(self) -> None:
        self.process.terminate()
        try:
            self.process.wait(WAIT_S)
        finally:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def start(workspace) -> Iterator[Callable[..., Server]]:
    started: list[Server] = []

    def start_one(*options: str, **given) -> Server:
        started.append(Server(workspace.root, *options, **given))
        return started[-1]

    yield start_one
    for one in started:
        one.close()


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.05)


def test_a_ready_server_names_its_parts(workspace):
    client = Client(create_app(workspace, ServerSettings()))
    response = client.get("/readyz")
    assert (response.status_code, response.headers["cache-control"]) == (200, "no-store")
    assert response.json() == {"workspace": "ok", "catalogue": "ok", "stores": "ok"}
    shutil.rmtree(workspace.root)
    response = client.get("/readyz")
    assert response.status_code == 503
    assert {name for name, state in response.json().items() if state != "ok"} >= {"workspace", "catalogue"}
    client.close()


def test_a_catalogue_that_hangs_is_named_and_delays_nothing_else(workspace, monkeypatch):
    """One thread waits for the catalogue, whatever the number of requests."""
    answers, calls = threading.Event(), []

    def wait(catalogue):
        calls.append(catalogue)
        answers.wait(WAIT_S)

    client = Client(create_app(workspace, ServerSettings()))
    monkeypatch.setattr(health, "_check_catalogue", wait)
    monkeypatch.setattr(health_route, "READY_S", 0.05)
    for _ in range(3):
        assert client.get("/readyz").json() == {"workspace": "ok", "catalogue": "no answer within 0.05 s", "stores": "ok"}
    assert client.get("/healthz").text == "ok\n"
    assert len(calls) == 1
    answers.set()
    wait_until(lambda: client.get("/readyz").status_code == 200)
    client.close()


def test_a_part_that_does_not_run_is_not_ready(workspace):
    runs = True
    client = Client(create_app(workspace, ServerSettings(), parts={"operations": lambda: runs}))
    assert (client.get("/readyz").status_code, client.get("/readyz").json()["operations"]) == (200, "ok")
    runs = False
    assert (client.get("/readyz").status_code, client.get("/readyz").json()["operations"]) == (503, "not running")
    client.close()


def test_a_server_names_its_operation_worker(start):
    server = start(worker=True)
    wait_until(lambda: httpx.get(server.address + "/readyz", timeout=WAIT_S).json()["operations"] == "ok")


def test_metrics_of_processes_are_added_up(tmp_path):
    one = Metrics(tmp_path)
    for seconds in (0.0005, 0.003, 99.0):
        one.begin()
        one.end(ROUTES.index("tile"), 200, seconds)
    one.begin()
    one.end(ROUTES.index("page"), 503, 0.2)
    one.begin()
    one.set_counter(list(COUNTERS).index("on_demand_rendered_blocks_total"), 7)
    ended = (tmp_path / str(os.getpid())).read_bytes()
    (tmp_path / "999999999").write_bytes(ended)
    text = render_metrics(tmp_path)
    values = dict(line.rsplit(" ", 1) for line in text.splitlines() if not line.startswith("#"))
    assert values['map3d_requests_total{route="tile",status="2xx"}'] == "6"
    assert values['map3d_requests_total{route="page",status="5xx"}'] == "2"
    assert values['map3d_request_seconds_bucket{route="tile",le="0.001"}'] == "2"
    assert values['map3d_request_seconds_bucket{route="tile",le="0.005"}'] == "4"
    assert values['map3d_request_seconds_bucket{route="tile",le="+Inf"}'] == values['map3d_request_seconds_count{route="tile"}'] == "6"
    assert values["map3d_on_demand_rendered_blocks_total"] == "14"
    assert (values["map3d_processes"], values["map3d_requests_running"]) == ("1", "1"), "an ended process has no gauges"
    names = re.findall(r"^# TYPE (\w+) (counter|gauge|histogram)$", text, re.MULTILINE)
    assert {re.sub(r"_(bucket|sum|count)$", "", name.partition("{")[0]) for name in values} == {name for name, _ in names}


def test_a_server_counts_its_requests_on_a_port_of_its_own(start):
    port = find_port("127.0.0.1", 0)
    server = start("--metrics", f"127.0.0.1:{port}", "--processes", "2")
    for _ in range(20):
        assert httpx.get(server.address + TILE).status_code == 200
    assert httpx.get(server.address + "/nothing").status_code == 404
    text = httpx.get(f"http://127.0.0.1:{port}/metrics").text
    assert 'map3d_requests_total{route="tile",status="2xx"} 20\n' in text
    assert 'map3d_requests_total{route="page",status="4xx"} 1\n' in text
    assert "map3d_processes 2\n" in text
    assert httpx.get(server.address + "/metrics").status_code == 404, "not on the public port"


def test_requests_are_logged_as_json_lines(start):
    server = start("--log-format", "json", "--access-log")
    given = httpx.get(server.address + TILE, headers={"x-request-id": "abc-1"})
    forged = httpx.get(server.address + "/healthz?token=secret", headers={"x-request-id": 'x"},{"level": "error'})
    assert given.headers["x-request-id"] == "abc-1"
    assert re.fullmatch("[0-9a-f]{16}", forged.headers["x-request-id"])
    wait_until(lambda: server.errors.read_text().count("\n") >= 2)
    first, second = (json.loads(line) for line in server.errors.read_text().splitlines()[:2])
    assert (first["logger"], first["request_id"], first["method"], first["path"]) == ("map3d.access", "abc-1", "GET", TILE.partition("?")[0])
    assert (first["status"], first["bytes"], first["client"]) == (200, len(given.content), "127.0.0.1")
    assert first["ms"] >= 0
    assert (second["path"], second["request_id"]) == ("/healthz", forged.headers["x-request-id"])
    assert "secret" not in server.errors.read_text()


class Clients:
    """Threads that send one request after another, each over a new connection, until `stop`.

    They send a request again, as browsers and proxies do, if the server closes the connection before it has read anything.
    """

    def __init__(self, address: str, number: int = 4) -> None:
        self.stop, self.answers, self.failures = threading.Event(), 0, []
        self._threads = [threading.Thread(target=self._run, args=(address,)) for _ in range(number)]
        for thread in self._threads:
            thread.start()

    def _run(self, address: str) -> None:
        while not self.stop.is_set():
            try:
                response = self._get(address + TILE)
                if response.status_code != 200:
                    self.failures.append(response.status_code)
            except httpx.HTTPError as error:
                self.failures.append(repr(error))
            self.answers += 1

    @staticmethod
    def _get(url: str) -> httpx.Response:
        try:
            return httpx.get(url, timeout=WAIT_S)
        except (httpx.RemoteProtocolError, httpx.ReadError):
            return httpx.get(url, timeout=WAIT_S)

    def end(self) -> None:
        self.stop.set()
        for thread in self._threads:
            thread.join()


def test_a_reload_fails_no_request_and_takes_new_settings(start, tmp_path):
    config = tmp_path / "server.toml"
    config.write_text("access_log = false\n")
    server = start("--config", str(config), "--log-format", "json")
    clients = Clients(server.address)
    wait_until(lambda: clients.answers > 20)
    config.write_text("access_log = true\n")
    server.signal(signal.SIGHUP)
    wait_until(lambda: '"map3d.access"' in server.errors.read_text())
    reached = clients.answers
    wait_until(lambda: clients.answers > reached + 50)
    clients.end()
    assert clients.failures == []


def test_a_reload_with_invalid_settings_keeps_the_old_ones(start, tmp_path):
    config = tmp_path / "server.toml"
    config.write_text("access_log = false\n")
    server = start("--config", str(config))
    config.write_text("acess_log = true\n")
    server.signal(signal.SIGHUP)
    wait_until(lambda: "the settings stay as they were" in server.errors.read_text())
    assert httpx.get(server.address + TILE).status_code == 200


def test_running_requests_are_answered_after_sigterm(start):
    """A request runs when the server has asked for its body. Whether a request that the server has not read yet is answered is a matter of
    microseconds: granian closes connections from which it has read nothing."""
    server = start()
    address = httpx.URL(server.address)
    with ExitStack() as stack:
        opened = [stack.enter_context(socket.create_connection((address.host, address.port), timeout=WAIT_S)) for _ in range(20)]
        running = opened[:10]
        for one in running:
            one.sendall(b"POST /sign-in HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nExpect: 100-continue\r\n\r\n")
        for one in running:
            assert one.recv(65536).startswith(b"HTTP/1.1 100")
        server.signal(signal.SIGTERM)
        wait_until(lambda: not accepts(address))
        for one in running:
            one.sendall(b"12345")
        for one in running:
            assert one.recv(65536).startswith(b"HTTP/1.1 403"), "the whole request has reached the app"
    assert server.process.wait(WAIT_S) == 0


def test_a_message_stays_one_line():
    record = logging.makeLogRecord(
        {"name": "map3d", "levelname": "ERROR", "msg": "no scene %r, %s", "args": ("a", "b\n2026 INFO forged\u2028\x1b[2J")}
    )
    text = TextFormatter().format(record)
    assert text.endswith("ERROR map3d: no scene 'a', b\\n2026 INFO forged\\u2028\\x1b[2J")


def test_web_processes_that_die_again_and_again_are_started_again(start):
    """granian itself gives up when a process dies twice within seconds."""
    server = start()
    for _ in range(3):
        wait_until(lambda: answers(server.address))
        os.kill(web_process(server), signal.SIGKILL)
    wait_until(lambda: answers(server.address))
    assert "they are started again in" in server.errors.read_text()
    server.signal(signal.SIGTERM)
    assert server.process.wait(WAIT_S) == 0


def answers(address: str) -> bool:
    try:
        return httpx.get(address + "/healthz", timeout=1).status_code == 200
    except httpx.HTTPError:
        return False


def web_process(server: Server) -> int:
    """Returns the process that listens."""
    children = Path(f"/proc/{server.process.pid}/task/{server.process.pid}/children").read_text().split()
    return next(int(pid) for pid in children if b"resource_tracker" not in Path(f"/proc/{pid}/cmdline").read_bytes())


def accepts(address: httpx.URL) -> bool:
    try:
        socket.create_connection((address.host, address.port), timeout=WAIT_S).close()
    except OSError:
        return False
    return True
