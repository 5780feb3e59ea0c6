"""Bodies are read before a thread takes the request."""

import asyncio
import socket
import threading
from contextlib import ExitStack

import httpx
import pytest
from starlette.exceptions import HTTPException

from map3d.web.http import bodies
from map3d.web.http.bodies import read_body
from tests.web.accounts import add_user, csrf_of
from tests.web.test_upload_route import Served


def read(parts, headers=((b"content-length", b"5"),), pause_s=0.0, most_bytes=1000):
    """Returns the body that `read_body` gives, or the status with which it refuses."""
    events = [{"type": "http.request", "body": part, "more_body": number + 1 < len(parts)} for number, part in enumerate(parts)]

    async def receive():
        await asyncio.sleep(pause_s)
        return events.pop(0)

    try:
        return asyncio.run(read_body({"headers": list(headers)}, receive, most_bytes))
    except HTTPException as error:
        return error.status_code if error.headers == {"Connection": "close"} else 0


def test_pieces_become_one_body():
    assert read([b"ab", b"c", b"de"]) == b"abcde"
    assert read([b"ab", b""], [(b"transfer-encoding", b"chunked")]) == b"ab"


def test_request_without_a_body_does_not_wait():
    assert read([], []) == read([], [(b"content-length", b"0")]) == b""


def test_size_is_limited():
    assert read([b"12345"], most_bytes=5) == b"12345"
    assert read([b"123", b"456"], most_bytes=5) == 413


@pytest.mark.parametrize("length", [b"6", b"9" * 4000])
def test_body_that_says_it_is_too_large_is_not_read(length):
    assert read([], [(b"content-length", length)], most_bytes=5) == 413


def test_body_without_an_end_is_refused():
    async def receive():
        return {"type": "http.disconnect"}

    with pytest.raises(HTTPException, match="connection broke"):
        asyncio.run(read_body({"headers": [(b"content-length", b"5")]}, receive, 1000))


def test_slow_body_is_refused(monkeypatch):
    monkeypatch.setattr(bodies, "BODY_S", 0.01)
    assert read([b"1", b"2"], pause_s=0.1) == 408


@pytest.fixture
def served(workspace, tmp_path):
    add_user(workspace)
    server = Served(workspace, tmp_path).start()
    yield server
    server.stop()


def test_slow_clients_hold_no_thread(served):
    """Twenty forms that never end, against eight threads; meanwhile a user signs in through the real server."""
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
