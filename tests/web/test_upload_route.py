"""The upload protocol, against https://tus.io/protocols/resumable-upload (version 1.0.0)."""

import base64
import hashlib
import http.client
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import httpx
import pytest

from map3d.web.uploads import upload_route
from map3d.web.uploads.upload_route import parse_metadata
from tests.web.accounts import add_token, add_user, csrf_of, sign_in
from tests.web.test_server import SCRIPT

TUS = {"Tus-Resumable": "1.0.0"}
PIECE = {"Content-Type": "application/offset+octet-stream"}


def metadata(**pairs):
    return {"Upload-Metadata": ",".join(f"{key} {base64.b64encode(value.encode()).decode()}" for key, value in pairs.items())}


@pytest.fixture
def token(workspace):
    add_user(workspace)
    return {**TUS, "Authorization": f"Bearer {add_token(workspace)}"}


def create(client, headers, size, name="a.gml", **options):
    response = client.request("POST", "/uploads/", headers={**headers, "Upload-Length": str(size), **metadata(filename=name)}, **options)
    assert response.status_code == 201, response.text
    return f"/uploads/{response.headers['location']}"


def test_options_tell_what_the_server_can(client):
    response = client.request("OPTIONS", "/uploads/")
    assert response.status_code == 204
    assert response.headers["tus-version"] == response.headers["tus-resumable"] == "1.0.0"
    assert set(response.headers["tus-extension"].split(",")) == {"creation", "creation-with-upload", "termination", "expiration", "checksum"}
    assert "sha1" in response.headers["tus-checksum-algorithm"].split(",")
    assert int(response.headers["tus-max-size"]) > 1 << 30


def test_pieces_arrive_in_order(client, token, workspace):
    data = os.urandom(3_000_000)
    url = create(client, token, len(data), "stadt/Gebäude.gml")
    for start in range(0, len(data), 1_000_000):
        head = client.request("HEAD", url, headers=token)
        assert (head.status_code, head.headers["cache-control"]) == (200, "no-store")
        assert (head.headers["upload-offset"], head.headers["upload-length"]) == (str(start), "3000000")
        assert head.headers["upload-expires"].endswith("GMT")
        sent = client.request("PATCH", url, headers={**token, **PIECE, "Upload-Offset": str(start)}, content=data[start : start + 1_000_000])
        assert (sent.status_code, sent.headers["upload-offset"]) == (204, str(start + 1_000_000))
    assert client.request("HEAD", url, headers=token).headers["upload-offset"] == "3000000"
    assert (workspace.root / url.lstrip("/") / "data").read_bytes() == data


def test_creation_with_upload(client, token, workspace):
    headers = {**token, **PIECE, "Upload-Length": "5", **metadata(filename="a", relativePath="city/a")}
    response = client.request("POST", "/uploads/", headers=headers, content=b"12345")
    assert (response.status_code, response.headers["upload-offset"]) == (201, "5")
    assert (workspace.root / "uploads" / response.headers["location"] / "data").read_bytes() == b"12345"


def test_empty_file_is_complete_at_once(client, token):
    head = client.request("HEAD", create(client, token, 0), headers=token)
    assert (head.headers["upload-offset"], head.headers["upload-length"]) == ("0", "0")
    assert "upload-expires" not in head.headers


def test_removed_upload_is_gone(client, token):
    url = create(client, token, 5)
    assert client.request("DELETE", url, headers=token).status_code == 204
    for method in ("HEAD", "DELETE"):
        assert client.request(method, url, headers=token).status_code == 404


@pytest.mark.parametrize("algorithm", ["sha1", "sha256", "md5"])
def test_damaged_piece_is_discarded(client, token, algorithm):
    url = create(client, token, 6)
    digest = base64.b64encode(hashlib.new(algorithm, b"123").digest()).decode()
    headers = {**token, **PIECE, "Upload-Offset": "0", "Upload-Checksum": f"{algorithm} {digest}"}
    assert client.request("PATCH", url, headers=headers, content=b"124").status_code == 460
    assert client.request("HEAD", url, headers=token).headers["upload-offset"] == "0"
    assert client.request("PATCH", url, headers=headers, content=b"123").status_code == 204
    for wrong in ("crc32 AAAA", "sha1", f"sha1 {digest}x=", "sha1 AAAA"):
        headers = {**token, **PIECE, "Upload-Offset": "3", "Upload-Checksum": wrong}
        assert client.request("PATCH", url, headers=headers, content=b"456").status_code == 400


@pytest.mark.parametrize(
    ("method", "path", "headers", "status"),
    [
        ("POST", "", {"Upload-Length": "x"}, 400),
        ("POST", "", {"Upload-Length": "-1"}, 400),
        ("POST", "", {"Upload-Length": "1" * 20}, 400),
        ("POST", "", {}, 400),
        ("POST", "", {"Upload-Length": "5"}, 400),
        ("POST", "", {"Upload-Length": "5", **metadata(filename="../../etc/passwd")}, 400),
        ("POST", "", {"Upload-Length": "5", "Upload-Metadata": "filename !!!"}, 400),
        ("POST", "", {"Upload-Length": "5", **metadata(filename="a", batch="../x")}, 400),
        ("POST", "", {"Upload-Length": "5", "Upload-Metadata": "filename " + "A" * 9_000}, 400),
        ("POST", "", {"Upload-Length": str(10**17), **metadata(filename="a")}, 413),
        ("POST", "x", {}, 405),
        ("PATCH", "", {}, 405),
        ("GET", "", {}, 405),
        ("PUT", "0" * 16, {}, 405),
        ("HEAD", "0" * 16, {}, 404),
        ("HEAD", "../catalogue.sqlite", {}, 404),
        ("PATCH", "0" * 16, {**PIECE, "Upload-Offset": "0"}, 404),
        ("PATCH", "0" * 16, {"Upload-Offset": "0"}, 415),
        ("PATCH", "0" * 16, {**PIECE, "Upload-Offset": "x"}, 400),
        ("POST", "", {"Tus-Resumable": "0.2.2", "Upload-Length": "1"}, 412),
    ],
)
def test_invalid_requests(client, token, workspace, method, path, headers, status):
    response = client.request(method, f"/uploads/{path}", headers={**token, **headers})
    assert response.status_code == status
    assert response.headers["cache-control"] == "no-store"
    assert str(workspace.root) not in response.text
    assert not [one for one in (workspace.root / "uploads").glob("*") if one.is_dir()]


def test_wrong_offset_is_a_conflict(client, token):
    url = create(client, token, 6)
    assert client.request("PATCH", url, headers={**token, **PIECE, "Upload-Offset": "3"}, content=b"456").status_code == 409


def test_method_override_for_clients_that_cannot_send_patch(client, token):
    url = create(client, token, 3)
    headers = {**token, **PIECE, "Upload-Offset": "0", "X-HTTP-Method-Override": "PATCH"}
    assert client.request("POST", url, headers=headers, content=b"123").status_code == 204


def test_full_disk_is_507(client, token, monkeypatch):
    url = create(client, token, 6)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("map3d.uploads.uploads.os.write", full)
    response = client.request("PATCH", url, headers={**token, **PIECE, "Upload-Offset": "0"}, content=b"456")
    assert response.status_code == 507
    assert "disk is full" in response.text


def test_writes_at_a_time_are_limited(client, token, monkeypatch):
    url = create(client, token, 6)
    monkeypatch.setattr(upload_route, "MAX_WRITES", 0)
    response = client.request("PATCH", url, headers={**token, **PIECE, "Upload-Offset": "0"}, content=b"456")
    assert (response.status_code, response.headers["retry-after"]) == (503, "5")
    monkeypatch.undo()
    assert client.request("PATCH", url, headers={**token, **PIECE, "Upload-Offset": "0"}, content=b"456").status_code == 204


def test_every_request_needs_an_editor(client, workspace):
    add_user(workspace)
    add_user(workspace, "ben", "viewer")
    viewer = {"Authorization": f"Bearer {add_token(workspace, 'ben')}"}
    for method, path in (("POST", ""), ("HEAD", "0" * 16), ("PATCH", "0" * 16), ("DELETE", "0" * 16)):
        refused = client.request(method, f"/uploads/{path}", headers=TUS)
        assert refused.status_code == 401
        assert refused.headers["www-authenticate"].startswith("Bearer")
        assert client.request(method, f"/uploads/{path}", headers={**TUS, **viewer}).status_code == 403
    assert not (workspace.root / "uploads").exists()


def test_browsers_send_the_csrf_value(client, workspace):
    add_user(workspace)
    sign_in(client)
    value = csrf_of(client.get("/account"))
    headers = {**TUS, "Upload-Length": "3", **metadata(filename="a")}
    assert client.request("POST", "/uploads/", headers=headers).status_code == 403
    assert client.request("POST", "/uploads/", headers={**headers, "X-CSRF-Token": "x"}).status_code == 403
    made = client.request("POST", "/uploads/", headers={**headers, "X-CSRF-Token": value})
    url = f"/uploads/{made.headers['location']}"
    assert client.request("HEAD", url, headers=TUS).status_code == 200
    piece = {**TUS, **PIECE, "Upload-Offset": "0"}
    assert client.request("PATCH", url, headers=piece, content=b"123").status_code == 403
    assert client.request("PATCH", url, headers={**piece, "X-CSRF-Token": value}, content=b"123").status_code == 204
    assert client.request("DELETE", url, headers=TUS).status_code == 403


def test_metadata_of_the_protocol():
    assert parse_metadata("filename d29ybGRfZG9taW5hdGlvbl9wbGFuLnBkZg==,is_confidential") == {
        "filename": "world_domination_plan.pdf",
        "is_confidential": "",
    }


class Served:
    """A server process that can be killed and started again."""

    def __init__(self, workspace, folder: Path):
        self._workspace, self._script = workspace, folder / "serve.py"
        self._script.write_text(SCRIPT)

    def start(self):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        command = [sys.executable, str(self._script), str(self._workspace.root), "1"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        self.address = httpx.URL(self.process.stdout.readline().strip())
        return self

    def stop(self, kind=signal.SIGKILL):
        self.process.send_signal(kind)
        self.process.wait(20)
        self.process.stdout.close()

    def worker_rss(self):
        """Returns the resident bytes of the process that serves, the child that listens."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        sizes = [Path(f"/proc/{child}/statm").read_text().split()[1] for child in children]
        return max(int(size) for size in sizes) * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture
def served(workspace, tmp_path):
    server = Served(workspace, tmp_path).start()
    yield server
    server.stop()


def broken_patch(address, url, headers, length, data):
    """Sends a part of a piece, then breaks the connection."""
    lines = [f"PATCH {url} HTTP/1.1", f"Host: {address.host}", f"Content-Length: {length}", *(f"{key}: {value}" for key, value in headers.items())]
    with socket.create_connection((address.host, address.port), timeout=10) as connection:
        connection.sendall("\r\n".join(lines).encode() + b"\r\n\r\n" + data)


def arrived(client, url, token, at_least):
    """Waits until the server has stored some bytes and no request writes any more; returns their number."""
    deadline_s = time.monotonic() + 60
    while True:
        assert time.monotonic() < deadline_s, "the bytes do not arrive"
        offset = int(client.head(url, headers=token).headers["upload-offset"])
        if offset >= at_least:
            return offset


def test_upload_survives_broken_connections_and_a_killed_server(served, token, workspace):
    data = os.urandom(12 << 20)
    with httpx.Client(base_url=served.address) as client:
        url = create(client, token, len(data))
        headers = {**token, **PIECE, "Upload-Offset": "0"}
        broken_patch(served.address, url, headers, len(data), data[: 5 << 20])
        offset = arrived(client, url, token, 5 << 20)
        assert offset == 5 << 20
    served.stop()
    served.start()
    with httpx.Client(base_url=served.address) as client:
        offset = int(client.head(url, headers=token).headers["upload-offset"])
        assert offset == 5 << 20
        sent = client.patch(url, headers={**token, **PIECE, "Upload-Offset": str(offset)}, content=data[offset:])
        assert sent.status_code == 204
    assert (workspace.root / url.lstrip("/") / "data").read_bytes() == data


def test_memory_does_not_grow_with_the_upload(served, token):
    """SAFETY: at most 256 MB, whatever is uploaded."""
    size, block = 600 << 20, b"\xa5" * (1 << 20)
    with httpx.Client(base_url=served.address) as client:
        url = create(client, token, size)
        before = served.worker_rss()
        connection = http.client.HTTPConnection(served.address.host, served.address.port, timeout=120)
        connection.request(
            "PATCH", url, body=(block for _ in range(600)), headers={**token, **PIECE, "Upload-Offset": "0", "Content-Length": str(size)}
        )
        response = connection.getresponse()
        assert (response.status, response.headers["upload-offset"]) == (204, str(size))
        connection.close()
        assert served.worker_rss() - before < 256 << 20
        assert client.delete(url, headers=token).status_code == 204
