"""The service with granian, a real port and several processes."""

import os
import signal
import socket
import subprocess
import sys
import time

import httpx
import pytest

from map3d.errors import BadRequest, NotFound
from map3d.types import TileId
from map3d.web.server.serve import find_port, serve
from tests.web.workspaces import every_tile, tile_bytes

SCRIPT = """
import sys
from functools import partial
from pathlib import Path
from map3d.web import serve
if __name__ == "__main__":
    serve(Path(sys.argv[1]), port=0, workers=int(sys.argv[2]), on_ready=partial(print, flush=True))
"""


@pytest.fixture(params=[1, 2])
def address(request, finished, tmp_path):
    script = tmp_path / "serve.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(finished.root), str(request.param)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    try:
        yield process.stdout.readline().strip()
        process.send_signal(signal.SIGINT if request.param == 1 else signal.SIGTERM)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.stdout.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_killed_server_leaves_no_process_behind(finished, tmp_path, workers):
    script = tmp_path / "serve.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(finished.root), str(workers)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    address = httpx.URL(process.stdout.readline().strip())
    process.kill()
    process.wait()
    process.stdout.close()
    deadline_s = time.monotonic() + 20
    while True:
        try:
            socket.create_connection((address.host, address.port), timeout=1).close()
        except ConnectionRefusedError:
            break
        assert time.monotonic() < deadline_s, "a process still listens"
        time.sleep(0.05)


def test_everything_is_served(address):
    with httpx.Client(base_url=address) as client:
        assert client.get("/healthz").text == "ok\n"
        assert client.get("/tiles/tea/rendering.json").json()["name"] == "tea"
        assert "Tea" in client.get("/renderings").text
        assert client.get("/").headers["location"] == "view/tea/"
        for tile in every_tile():
            path = f"/tiles/tea/0-45/depth/{tile.z}/{tile.x}/{tile.y}"
            assert client.get(path).content == client.get(f"{path}?v=1").content == tile_bytes("0-45", "depth", tile)
        empty = client.get("/tiles/tea/0-45/id/4/15/0?v=1")
        assert (empty.status_code, empty.content) == (204, b"")
        head = client.head("/tiles/tea/0-45/id/0/0/0")
        assert (head.status_code, head.content) == (200, b"")
        assert int(head.headers["content-length"]) == len(tile_bytes("0-45", "id", TileId(0, 0, 0)))


def _ask(address, request):
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    with socket.create_connection((host, int(port)), timeout=10) as connection:
        connection.sendall(request)
        return connection.recv(65536)


@pytest.mark.parametrize("address", [1], indirect=True)
def test_malformed_requests_are_client_errors(address):
    tile = b"/tiles/tea/0-45/color/0/0/0"
    for target in (b"/?\xd9\xa1", b"/\xff", b"/%ff%fe", b"/%00", tile + b"?v=\xff", tile + b"%zz", b"//" + tile, b"/tiles/tea/%ff/color/0/0/0", b"*"):
        for method in (b"GET", b"HEAD", b"POST", b"FOO"):
            head = _ask(address, method + b" " + target + b" HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 ")
            assert 200 <= int(head[9:12]) < 500, (method, target)


def test_a_port_in_use_is_refused():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(BadRequest, match="--port"):
            find_port("127.0.0.1", port)


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 70000), ("no-such-host.invalid", 0)])
def test_an_invalid_address_is_refused(host, port):
    with pytest.raises(BadRequest):
        find_port(host, port)


def test_port_zero_finds_a_free_port():
    port = find_port("127.0.0.1", 0)
    assert port > 0
    assert find_port("127.0.0.1", port) == port


def test_a_missing_workspace_is_refused_before_the_server_starts(tmp_path):
    with pytest.raises(NotFound):
        serve(tmp_path / "none")
