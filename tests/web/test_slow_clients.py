"""Clients that open connections and say nothing, or little, do not keep others from being served."""

import os
import resource
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator

import httpx
import pytest

from tests.web.test_server import SCRIPT

CONNECTIONS = 2_100
HEAD = b"GET /healthz HTTP/1.1\r\nHost: x\r\n"


IMPATIENT = "from map3d.web import server\nserver.HEADER_TIMEOUT_MS = 1_000\n"


@pytest.fixture
def address(finished, tmp_path, request) -> Iterator[httpx.URL]:
    """The address of a server; a parameter is code that runs first."""
    script = tmp_path / "serve.py"
    script.write_text(getattr(request, "param", "") + SCRIPT)
    command = [sys.executable, str(script), str(finished.root), "1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
    yield httpx.URL(process.stdout.readline().strip())
    try:
        process.send_signal(signal.SIGTERM)
        process.wait(20)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.fixture
def many_files() -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    if before[1] < 2 * CONNECTIONS:
        pytest.skip(f"this system allows {before[1]} open files, {2 * CONNECTIONS} are needed")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(before[0], 2 * CONNECTIONS), before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.parametrize("sent", [b"", HEAD + b"X: ", HEAD + b"\r\n"], ids=["nothing", "half a head", "a request, then nothing"])
def test_idle_connections_do_not_hold_the_server(address, many_files, sent):
    """The server answers others while all idle connections are still open, so they did not have to end first."""
    idle = []
    try:
        for _ in range(CONNECTIONS):
            idle.append(socket.create_connection((address.host, address.port), timeout=20))
            idle[-1].sendall(sent)
        assert httpx.get(address.join("/healthz"), timeout=60).text == "ok\n"
        assert not [one for one in idle if _is_closed(one)]
    finally:
        for one in idle:
            one.close()


@pytest.mark.parametrize("address", [IMPATIENT], indirect=True, ids=["impatient"])
def test_a_connection_without_a_request_is_closed(address):
    with socket.create_connection((address.host, address.port), timeout=60) as connection:
        connection.sendall(HEAD)
        received = b""
        while data := connection.recv(65536):
            received += data
        assert not received.startswith(b"HTTP/1.1 200")


def _is_closed(connection: socket.socket) -> bool:
    """Reads what has arrived; returns whether that includes the end of the connection."""
    poller = select.poll()
    poller.register(connection, select.POLLIN)
    while poller.poll(0):
        if not connection.recv(65536):
            return True
    return False
