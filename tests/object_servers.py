"""Real object stores on loopback: an S3 server in a process of its own (moto), and a folder."""

import os
import subprocess
import sys
import urllib.error
import urllib.request
import uuid
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.leftovers import session_processes

_SERVER = """
import threading
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import WSGIRequestHandler, make_server

WSGIRequestHandler.log_request = lambda *_: None
app, lock = DomainDispatcherApplication(create_backend_app), threading.Lock()

def one_at_a_time(environ, start_response):
    # moto checks conditions and writes in two steps; S3 does it in one.
    with lock:
        answer = app(environ, start_response)
        return [b"".join(answer)]

server = make_server("127.0.0.1", 0, one_at_a_time, threaded=True)
print(server.server_port, flush=True)
server.serve_forever()
"""
BUCKET = "tiles"


@contextmanager
def s3_server() -> Iterator[str]:
    """Starts an S3 server with one bucket and yields its endpoint."""
    pytest.importorskip("obstore", reason="obstore is not installed: pip install 'map3d[cloud]'")
    pytest.importorskip("moto.server", reason="the S3 server moto is not installed: pip install -r requirements/test.lock")
    process = subprocess.Popen([sys.executable, "-c", _SERVER], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    session_processes.add(process.pid)
    try:
        assert process.stdout is not None
        endpoint = f"http://127.0.0.1:{int(process.stdout.readline())}"
        with urllib.request.urlopen(urllib.request.Request(f"{endpoint}/{BUCKET}", method="PUT"), timeout=30) as answer:
            assert answer.status == 200
        yield endpoint
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()


def s3_environment(endpoint: str) -> dict[str, str]:
    """Returns the environment in which map3d uses the server."""
    return {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": "test-key",
        "AWS_SECRET_ACCESS_KEY": "test-secret",
        "AWS_REGION": "us-east-1",
    }


@contextmanager
def environment(values: dict[str, str]) -> Iterator[None]:
    """Sets variables, and restores the earlier ones."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def new_prefix() -> str:
    """Returns the URL of a new, empty place in the bucket."""
    return f"s3://{BUCKET}/{uuid.uuid4().hex}"
