"""Uploads by clients of the tus protocol that others wrote: tus-js-client and tuspy break off and resume."""

import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from tests.web.accounts import add_token, add_user
from tests.web.test_upload_route import Served

pytestmark = pytest.mark.third_party
SIZE = 20_000_000
ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "viewer" / "node_modules" / "tus-js-client"


@pytest.fixture
def served(workspace, tmp_path):
    server = Served(workspace, tmp_path).start()
    yield server
    server.stop()


@pytest.fixture
def token(workspace):
    add_user(workspace)
    return add_token(workspace)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "Straße.gml"
    path.write_bytes(os.urandom(SIZE))
    return path


def uploads(served):
    return str(served.address.join("/uploads/"))


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check_arrived(workspace, url, file):
    """The upload with this address has the bytes of the file and its name."""
    folder = workspace.root / "uploads" / str(url).rsplit("/", 1)[-1]
    assert digest(folder / "data") == digest(file)
    assert json.loads((folder / "info.json").read_text("utf-8"))["name"] == file.name


@pytest.mark.parametrize("piece", [0, 4_000_000], ids=["one piece", "pieces of 4 MB"])
def test_tus_js_client(served, workspace, token, file, piece):
    node = shutil.which("node")
    if node is None or not PACKAGE.is_dir():
        pytest.skip("tus-js-client is not installed; run make .cache/npm")
    asked = {"url": uploads(served), "token": token, "file": str(file), "pieceBytes": piece, "breakAt": 9_000_000, "name": file.name}
    command = [node, str(Path(__file__).with_name("tus_client.mjs")), str(PACKAGE), json.dumps(asked)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    seen = json.loads(done.stdout)
    assert 9_000_000 <= seen["broken"] < SIZE
    assert seen["statuses"].count("POST 201") == 1
    assert seen["statuses"].count("HEAD 200") == 1
    check_arrived(workspace, seen["url"], file)


def tuspy(**asked):
    done = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("tuspy_client.py")), json.dumps(asked)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.skipif(importlib.util.find_spec("tusclient") is None, reason="tuspy is not installed; run make .cache/venv")
@pytest.mark.parametrize("checksum", [False, True])
def test_tuspy(served, workspace, token, file, checksum):
    """The server is killed between the pieces and starts again at another address."""
    asked = {"token": token, "file": str(file), "checksum": checksum}
    first = tuspy(**asked, uploads=uploads(served), stop_at=8_000_000)
    assert (first["start"], first["offset"]) == (0, 8_000_000)
    served.stop()
    served.start()
    again = tuspy(**asked, uploads=uploads(served), url=str(served.address.join(httpx.URL(first["url"]).path)))
    assert (again["start"], again["offset"]) == (8_000_000, SIZE)
    check_arrived(workspace, again["url"], file)
