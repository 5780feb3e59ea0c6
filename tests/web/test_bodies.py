"""Bodies are read before a thread takes the request."""

import asyncio
import socket
import threading
from contextlib import ExitStack

import httpx
import pytest
from starlette.exceptions import HTTPException

from map3d.web.http import bodies
from map3d.web.http.bodies import Bodies, has_body
from tests.web.accounts import add_user, csrf_of
from tests.web.test_upload_route import Served


def read(parts, headers=((b"content-length", b"5"),), pause_s=0.0, most_bytes=1000, stranger=None, held=None):
    """Returns the body, or the status with which it is refused."""
    events = [{"type": "http.request", "body": part, "more_body": number + 1 < len(parts)} for number, part in enumerate(parts)]

    async def receive():
        await asyncio.sleep(pause_s)
        return events.pop(0)

    try:
        with (held or Bodies()).hold(stranger) as body:
            return asyncio.run(body.read({"headers": list(headers)}, receive, most_bytes))
    except HTTPException as error:
        return error.status_code if (error.headers or {}).get("Connection") == "close" else 0


def test_pieces_become_one_body():
    assert read([b"ab", b"c", b"de"]) == b"abcde"
    assert read([b"ab", b""], [(b"transfer-encoding", b"chunked")]) == b"ab"


@pytest.mark.parametrize(
    ("headers", "expected"),
    [([], False), ([(b"content-length", b"0")], False), ([(b"content-length", b"1")], True), ([(b"transfer-encoding", b"chunked")], True)],
)
def test_headers_tell_whether_there_is_a_body(headers, expected):
    assert has_body({"headers": headers}) is expected


def test_what_is_held_at_a_time_is_limited(monkeypatch):
    """By client for those who have not signed in, and for all together; what is answered is no longer held."""
    monkeypatch.setattr(bodies, "MOST_STRANGER_BYTES", 8)
    monkeypatch.setattr(bodies, "MOST_BYTES", 20)
    held = Bodies()
    with held.hold("a") as first, held.hold() as member:
        held.take(5, "a")
        first.size_bytes = 5
        assert read([b"12345"], stranger="a", held=held) == 429
        assert read([b"12345"], stranger="b", held=held) == b"12345"
        held.take(12, None)
        member.size_bytes = 12
        assert read([b"1234"], held=held) == 503
        assert read([b"123"], held=held) == b"123"
    assert held.held_bytes == 0
    assert read([b"12345"], stranger="a", held=held) == b"12345"


def test_size_is_limited():
    assert read([b"12345"], most_bytes=5) == b"12345"
    assert read([b"123", b"456"], most_bytes=5) == 413


@pytest.mark.parametrize("length", [b"6", b"9" * 4000])
def test_body_that_says_it_is_too_large_is_not_read(length):
    assert read([], [(b"content-length", length)], most_bytes=5) == 413


def test_body_without_an_end_is_refused():
    async def receive():
        return {"type": "http.disconnect"}

    with Bodies().hold() as body, pytest.raises(HTTPException, match="connection broke"):
        asyncio.run(body.read({"headers": [(b"content-length", b"5")]}, receive, 1000))


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


@pytest.mark.parametrize(
    ("path", "status"), [("/nowhere", 404), ("/api/v1/scenes", 401), ("/uploads/", 401), ("/healthz", 405), ("/renderings", 405), ("/sign-in", 413)]
)
def test_a_body_that_is_not_wanted_is_not_waited_for(served, path, status):
    """The answer comes while the body is still to be sent: routes and rights come before bodies."""
    head = f"POST {path} HTTP/1.1\r\nHost: {served.address.host}\r\nContent-Length: 60000\r\nContent-Type: application/json\r\n\r\n"
    with socket.create_connection((served.address.host, served.address.port), timeout=20) as connection:
        connection.sendall(head.encode())
        assert connection.recv(65536).startswith(f"HTTP/1.1 {status}".encode())
