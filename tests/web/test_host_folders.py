"""No text that leaves the server names folders of its host: REST API, error responses, pages."""

import json
from pathlib import Path

import pytest

from map3d.catalogue import OperationState, PlannedJob, Workspace
from map3d.catalogue.states import MAX_ATTEMPTS
from map3d.errors import BadRequest, NotFound
from map3d.messages import verbatim
from map3d.operations.operation_worker import OperationWorker
from map3d.operations.uploaded_files import IMPORT_FOLDERS
from map3d.types import BlockId
from map3d.uploads import Uploads
from map3d.web.http.host_folders import without_host_folders
from map3d.web.server.asgi_app import create_app
from tests.web.accounts import add_token, add_user
from tests.web.conftest import Client, asked_of
from tests.web.test_api import Api

ENDED = (OperationState.DONE, OperationState.FAILED, OperationState.CANCELLED)


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("/srv/data/town.gml: no such file or folder", "town.gml: no such file or folder"),
        ("cannot read '/srv/data/a.gml' and (/srv/b.obj)", "cannot read 'a.gml' and (b.obj)"),
        ("path=/srv/data/a.gml, [/srv/data/b.gml]", "path=a.gml, [b.gml]"),
        ("file:///srv/tiles/tea/0-45 is damaged", "0-45 is damaged"),
        ("{root}/scenes/town/registry.sqlite: locked", "scenes/town/registry.sqlite: locked"),
        ("{root}/uploads/.operation-17/hut.obj: no triangle", "hut.obj: no triangle"),
        ("no workspace at {root}", "no workspace at ."),
        ("see https://example.org/a/b and s3://bucket/a/b", "see https://example.org/a/b and s3://bucket/a/b"),
        ("textures/wall.png is missing; 3/4 of all, km/h, EPSG:25832", "textures/wall.png is missing; 3/4 of all, km/h, EPSG:25832"),
    ],
)
def test_folders_of_the_host_are_left_out(client: Client, workspace: Workspace, text: str, shown: str) -> None:
    with asked_of(client.app):
        assert without_host_folders(text.replace("{root}", str(workspace.root.absolute()))) == shown


@pytest.fixture
def api(client: Client, workspace: Workspace) -> Api:
    add_user(workspace)
    return Api(client, workspace, add_token(workspace))


def test_reports_and_logs_of_the_api_name_files_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A broken upload and a broken file of the host: neither message nor log nor arguments name a folder of the host."""
    workspace = Workspace(tmp_path / "hidden" / "workspace").create()
    catalogue = workspace.open_catalogue()
    add_user(workspace)
    data = tmp_path / "hidden" / "data"
    data.mkdir()
    (data / "broken.obj").write_text("f 1 2 3\n")
    monkeypatch.setenv(IMPORT_FOLDERS, str(data))
    client = Client(create_app(workspace))
    api = Api(client, workspace, add_token(workspace))
    api.post("/scenes", {"name": "town"}, 201)
    uploads = Uploads(workspace.root / "uploads")
    upload = uploads.create("anna", "hut.obj", 8)
    with uploads.write(upload.id, "anna", 0) as writer:
        writer.write(b"f 1 2 3\n")
    answers: list[object] = []
    for arguments in ({"files": [upload.id]}, {"paths": [str(data / "broken.obj")]}):
        asked = api.post("/operations", {"kind": "import", "target": "town", "arguments": arguments}, 202)
        ended = asked
        while ended["state"] not in ENDED:  # a worker that loses its lease on a busy machine leaves the operation waiting
            OperationWorker(workspace, catalogue, poll_s=0.05).run(forever=False)
            ended = api.get(f"/operations/{asked['id']}")
        assert ended["state"] == OperationState.FAILED
        assert "no usable triangle" in ended["message"]
        answers += [asked, ended, api.get(f"/operations/{asked['id']}/log"), api.get("/operations")]
    answers.append(api.post("/operations", {"kind": "import", "target": "town", "arguments": {"paths": ["/etc/passwd"]}}, 400))
    answers.append(api.post("/operations", {"kind": "import", "target": "town", "arguments": {"paths": [str(data / "nothing.obj")]}}, 404))
    text = json.dumps(answers)
    assert ("broken.obj" in text, "hut.obj" in text) == (True, True)
    assert [place for place in (str(tmp_path), "hidden", "/etc", ".operation-") if place in text] == []
    stored = " ".join(str(line.text) for record in catalogue.operations() for line in catalogue.operation_log(record.id))
    assert str(data) in stored, "the server's own log still has the whole path"
    client.close()
    catalogue.close()


def test_reasons_of_failed_blocks_name_no_folder(api: Api) -> None:
    catalogue = api.workspace.open_catalogue()
    catalogue.plan("tea", [PlannedJob("0-45", BlockId(1, 0, 0), "base", 0, "k", None)])
    for _ in range(MAX_ATTEMPTS):
        lease = catalogue.lease("tea", "w")
        assert lease is not None
        catalogue.fail(lease, verbatim(f"{api.workspace.root.absolute()}/renderings/tea/tiles.sqlite and /srv/secret/disk are full"))
    catalogue.close()
    found = api.get("/renderings/tea/failures")["failures"]
    assert [failure["reason"] for failure in found] == ["renderings/tea/tiles.sqlite and disk are full"]


@pytest.mark.parametrize(("error", "status"), [(BadRequest("/srv/secret/a.gml: is odd"), 400), (NotFound("no /srv/secret/a.gml"), 404)])
@pytest.mark.parametrize("accept", ["application/json", "text/plain", "text/html"])
def test_errors_name_no_folder(api: Api, monkeypatch: pytest.MonkeyPatch, error: Exception, status: int, accept: str) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("map3d.web.api.routes.create_scene", fail)
    monkeypatch.setattr("map3d.web.pages.page_routes.catalogue", fail)
    problem = api.send("POST", "/scenes", json={"name": "x"}, headers={"accept": accept})
    page = api.client.get("/", headers={"accept": accept})
    assert (problem.status_code, page.status_code) == (status, status)
    assert "a.gml" in problem.text
    assert "secret" not in problem.text + page.text
