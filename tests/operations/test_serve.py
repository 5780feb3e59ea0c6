"""`map3d serve` with its operation worker: a program asks for operations over a real port and reads how they go."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from map3d.accounts import Accounts
from map3d.operations.uploaded_files import IMPORT_FOLDERS
from tests.cli.towns import write_town
from tests.operations.scenario import Scenario, is_running, wait_for


@pytest.fixture
def server(scenario: Scenario, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "map3d", "serve", "--port", "0", "-w", str(scenario.workspace.root)]
    environment = {**os.environ, IMPORT_FOLDERS: str(tmp_path / "files")}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        yield process
        process.kill()


def test_town_is_imported_built_and_rendered_over_http(server: "subprocess.Popen[str]", scenario: Scenario, tmp_path: Path) -> None:
    accounts = Accounts(scenario.catalogue)
    accounts.add_user("anna", "correct horse battery", "editor")
    token = accounts.add_token("anna", "test", "editor")[1]
    files = write_town(tmp_path / "files", 2)
    assert server.stdout is not None
    address = re.search(r"http://[0-9.:]+/", server.stdout.readline())
    assert address is not None
    workers = set()
    with httpx.Client(base_url=f"{address[0]}api/v1/", headers={"authorization": f"Bearer {token}"}, timeout=60) as client:

        def do(kind: str, **arguments: Any) -> None:
            asked = client.post("operations", json={"kind": kind, "target": "town", "arguments": arguments})
            assert asked.status_code == 202, asked.text
            path = asked.headers["location"]
            wait_for(lambda: client.get(path).json()["state"] not in ("waiting", "running"), kind)
            ended = client.get(path).json()
            assert ended["state"] == "done", ended
            workers.add(kind)

        do("import", paths=[str(files)])
        do("build")
        body = {"scene": "town", "name": "town", "views": [[0, 45]], "res_m": 0.2, "layers": ["color"]}
        assert client.post("renderings", json=body).status_code == 201
        do("render")
        assert client.get("renderings/town/jobs").json()["complete"]
        children = Path(f"/proc/{server.pid}/task/{server.pid}/children").parent.parent
        pids = {int(pid) for task in children.iterdir() for pid in (task / "children").read_text().split()}
        working = {pid for pid in pids if b"map3d.operations" in Path(f"/proc/{pid}/cmdline").read_bytes()}
        assert len(working) == 1, "one operation worker runs beside the web processes"
    assert workers == {"import", "build", "render"}
    server.send_signal(signal.SIGTERM)
    assert server.wait(60) == 0
    assert not any(is_running(pid) for pid in working)
