"""Imports a folder of boxes by one of the fronts, and prints what came of it as JSON: `python fronts.py cli|rest|studio WORKSPACE FOLDER`."""

import contextlib
import io
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import Workspace
from map3d.cli import app
from map3d.operations.operation_worker import OperationWorker
from map3d.uploads import Uploads
from map3d.web import create_app
from tests.web.accounts import add_token, add_user
from tests.web.conftest import Client


def by_command_line(workspace: Workspace, folder: Path) -> str:
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        for command in (("create-scene", "town"), ("add-files", "town", str(folder)), ("inspect", str(folder / "houses.boxes"))):
            app.run([*command, *(() if command[0] == "inspect" else ("-w", str(workspace.root)))])
    return said.getvalue()


def by_rest(workspace: Workspace, folder: Path) -> str:
    with _signed_in(workspace) as client:
        client.send("/api/v1/scenes", json={"name": "town"})
        arguments = {"files": _upload(workspace, folder), "options": {"crs": "local"}}
        client.send("/api/v1/operations", json={"kind": "import", "target": "town", "arguments": arguments})
        _work(workspace)
        return str(client.client.get("/api/v1/scenes/town/assets", headers=client.headers).text)


def in_the_studio(workspace: Workspace, folder: Path) -> str:
    with _signed_in(workspace) as client:
        client.send("/studio/scenes/new", data={"title": "Town", "name": "town", "crs": "local"})
        client.send("/studio/scenes/town/import", data={"file": _upload(workspace, folder)})
        _work(workspace)
        return str(client.client.get("/studio/scenes/town", headers=client.headers).text)


FRONTS: Final[Mapping[str, Callable[[Workspace, Path], str]]] = {"cli": by_command_line, "rest": by_rest, "studio": in_the_studio}


class _Editor:
    def __init__(self, workspace: Workspace) -> None:
        add_user(workspace)
        self.client = Client(create_app(workspace))
        self.headers = {"authorization": f"Bearer {add_token(workspace)}"}

    def send(self, path: str, **body: Any) -> None:
        answer = self.client.request("POST", path, headers=self.headers, **body)
        assert answer.status_code < 400, answer.text


@contextlib.contextmanager
def _signed_in(workspace: Workspace) -> Any:
    editor = _Editor(workspace)
    try:
        yield editor
    finally:
        editor.client.close()


def _upload(workspace: Workspace, folder: Path) -> list[str]:
    uploads, made = Uploads(workspace.root / "uploads"), []
    for path in sorted(folder.iterdir()):
        upload = uploads.create("anna", path.name, path.stat().st_size)
        with uploads.write(upload.id, "anna", 0) as writer:
            writer.write(path.read_bytes())
        made.append(upload.id)
    return made


def _work(workspace: Workspace) -> None:
    with contextlib.closing(workspace.open_catalogue()) as catalogue:
        OperationWorker(workspace, catalogue, poll_s=0.02, heartbeat_s=0.1).run(forever=False)


def _result(workspace: Workspace, shown: str) -> dict[str, Any]:
    with contextlib.closing(workspace.open_catalogue()) as catalogue:
        assets = [{"name": asset.name, "format": asset.format, "report": asset.report} for asset in catalogue.assets("town")]
        log = [str(line.text) for one in catalogue.operations() for line in catalogue.operation_log(one.id)]
    return {"assets": assets, "shown": shown, "log": log}


if __name__ == "__main__":
    opened = Workspace(Path(sys.argv[2])).create()
    print(json.dumps(_result(opened, FRONTS[sys.argv[1]](opened, Path(sys.argv[3])))))
