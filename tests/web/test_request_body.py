"""Bodies are read before a thread of Flask takes the request."""

import asyncio
import socket
import threading
from contextlib import ExitStack

import httpx
import pytest

from map3d.web.server import request_body
from map3d.web.server.request_body import read_body
from tests.web.accounts import add_user, csrf_of
from tests.web.test_upload_route import Served


def read(parts, headers=((b"content-length", b"5"),), pause_s=0.0):
    """Returns the body that `read_body` gives, or the status with which it refuses."""
    sent, events = [], [{"type": "http.request", "body": part, "more_body": number + 1 < len(parts)} for number, part in enumerate(parts)]

    async def receive():
        await asyncio.sleep(pause_s)
        return events.pop(0)

    async def send(event):
        sent.append(event)

    async def act():
        body = await read_body({"headers": list(headers)}, receive, send)
        return sent[0]["status"] if body is None else (await body())["body"]

    return asyncio.run(act())


def test_pieces_become_one_body():
    assert read([b"ab", b"c", b"de"]) == b"abcde"
    assert read([b"ab", b""], [(b"transfer-encoding", b"chunked")]) == b"ab"


def test_request_without_a_body_does_not_wait():
    assert read([], []) == read([], [(b"content-length", b"0")]) == b""


def test_size_is_limited(monkeypatch):
    monkeypatch.setattr(request_body, "MAX_BODY_BYTES", 5)
    assert read([b"12345"]) == b"12345"
    assert read([b"123", b"456"]) == 413


def test_slow_body_is_refused(monkeypatch):
    monkeypatch.setattr(request_body, "BODY_S", 0.01)
    assert read([b"1", b"2"], pause_s=0.1) == 408


@pytest.fixture
def served(workspace, tmp_path):
    add_user(workspace)
    server = Served(workspace, tmp_path).start()
    yield server
    server.stop()


def test_slow_clients_hold_no_thread(served):
    """Twenty forms that never end, against the eight threads of Flask; meanwhile a user signs in through the real server."""
    fields = f"Host: {served.address.host}\r\nContent-Length: 100\r\nContent-Type: application/x-www-form-urlencoded"
    head = f"POST /sign-in HTTP/1.1\r\n{fields}\r\n\r\nname="
    answers = []

    def sign_in():
        with httpx.Client(base_url=served.address, timeout=20) as client:
            form = {"csrf": csrf_of(client.get("/sign-in")), "name": "anna", "password": "correct horse battery"}
            answers.append(client.post("/sign-in", data=form).status_code)

    thread = threading.Thread(target=sign_in)
    with ExitStack() as stack:
        for _ in range(20):
            slow = stack.enter_context(socket.create_connection((served.address.host, served.address.port), timeout=10))
            slow.sendall(head.encode())
        thread.start()
        thread.join(25)
    thread.join()
    assert answers == [303]
