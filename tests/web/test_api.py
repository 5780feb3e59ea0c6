"""The REST API: its OpenAPI document is valid and complete, and every answer and every error is as it says."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from jsonschema import Draft202012Validator
from openapi_spec_validator import validate

from map3d.catalogue import OperationState, PlannedJob, Workspace
from map3d.catalogue.states import MAX_ATTEMPTS
from map3d.messages import verbatim
from map3d.operations.operation_worker import OperationWorker
from map3d.types import BlockId
from map3d.uploads import Uploads
from map3d.web.server.asgi_app import create_app
from tests.cli.towns import house
from tests.web.accounts import add_token, add_user
from tests.web.conftest import Client

ROOT = "/api/v1"
PROBLEM = "application/problem+json"


class Api:
    """Sends requests with a token, and checks every answer against the OpenAPI document."""

    def __init__(self, client: Client, workspace: Workspace, token: str | None) -> None:
        self.client, self.workspace, self.token = client, workspace, token
        self.document = client.get(f"{ROOT}/openapi.json").json()

    def send(self, method: str, path: str, status: int | None = None, *, token: str | None = "", **options) -> httpx.Response:
        sent = self.token if token == "" else token
        headers = {**({"authorization": f"Bearer {sent}"} if sent else {}), **options.pop("headers", {})}
        response = self.client.request(method, ROOT + path, headers=headers, **options)
        assert status is None or response.status_code == status, response.text
        self.check(method, path, response)
        return response

    def get(self, path: str, status: int = 200, **options):
        return self.send("GET", path, status, **options).json()

    def post(self, path: str, body: object = None, status: int = 200, **options):
        return self.send("POST", path, status, **({} if body is None else {"json": body}), **options).json()

    def check(self, method: str, path: str, response: httpx.Response) -> None:
        """An answer that is not an error has the schema of its path; an error is a problem with the answer's status."""
        assert response.headers["cache-control"] == "no-store"
        assert response.headers["x-content-type-options"] == "nosniff"
        if response.status_code >= 400:
            assert response.headers["content-type"] == PROBLEM
            problem = response.json()
            assert problem["status"] == response.status_code
            self.validate({"$ref": "#/components/schemas/Problem"}, problem)
            return
        template = next(one for one in self.document["paths"] if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", one), path.partition("?")[0]))
        described = self.document["paths"][template][method.lower()]["responses"][str(response.status_code)]
        self.validate(described["content"]["application/json"]["schema"], response.json())

    def validate(self, schema, value) -> None:
        Draft202012Validator({**schema, "components": self.document["components"]}).validate(value)


@pytest.fixture
def api(client: Client, workspace: Workspace) -> Api:
    """The API of a workspace with a scene `town` and a rendering `tea`, for an editor."""
    add_user(workspace)
    return Api(client, workspace, add_token(workspace))


@pytest.fixture
def empty(tmp_path: Path) -> Iterator[Api]:
    """The API of an empty workspace, for an editor."""
    workspace = Workspace(tmp_path / "empty").create()
    workspace.open_catalogue().close()
    add_user(workspace)
    client = Client(create_app(workspace))
    yield Api(client, workspace, add_token(workspace))
    client.close()


def test_document_is_valid_and_has_every_route(api: Api) -> None:
    validate(api.document)
    listed = {(method.upper(), path) for path, methods in api.document["paths"].items() for method in methods}
    rules = {(rule.method, rule.path.removeprefix(ROOT)) for rule in api.client.app.views.rules if rule.path.startswith(ROOT)}
    assert listed == rules
    assert len(listed) == 19
    assert api.document["servers"] == [{"url": "http://test/api/v1"}]


def test_description_of_roles_is_that_of_the_guards(api: Api) -> None:
    viewer = add_viewer(api)
    for path, methods in api.document["paths"].items():
        for method, described in methods.items():
            role = described.get("description", "").removeprefix("Needs the role ").rstrip(".")
            concrete = re.sub(r"\{\w+\}", "nothing", path)
            assert (api.send(method.upper(), concrete, token=None).status_code == 401) == bool(role), path
            assert (api.send(method.upper(), concrete, token=viewer).status_code == 403) == (role == "editor"), path
            assert role == "editor" or method == "get"
            assert ("security" in described) == bool(role)


def add_viewer(api: Api) -> str:
    add_user(api.workspace, "bob", "viewer")
    return add_token(api.workspace, "bob", "viewer")


def test_scenes_are_created_listed_in_pages_and_described(empty: Api) -> None:
    for name in ("c", "a", "b"):
        created = empty.send("POST", "/scenes", 201, json={"name": name, "title": name.upper(), "crs": "EPSG:25832"})
        assert created.headers["location"] == f"scenes/{name}"
    assert [scene["name"] for scene in empty.get("/scenes")["scenes"]] == ["a", "b", "c"]
    first = empty.get("/scenes?limit=2")
    assert ([scene["name"] for scene in first["scenes"]], first["next"]) == (["a", "b"], "b")
    second = empty.get(f"/scenes?limit=2&after={first['next']}")
    assert ([scene["name"] for scene in second["scenes"]], second.get("next")) == (["c"], None)
    scene = empty.get("/scenes/a")
    assert (scene["title"], scene["crs"]["epsg"], scene["built"], "origin" in scene) == ("A", 25832, False, False)
    assert empty.post("/scenes", {"name": "a"}, 409)["title"] == "Conflict"
    assert "no scene 'd'; existing scenes: a, b, c" in empty.get("/scenes/d", 404)["detail"]


@pytest.mark.parametrize(
    ("body", "detail"),
    [
        ({}, "'name' is a required property"),
        ({"name": "No Name"}, "does not match"),
        ({"name": "a", "unknown": 1}, "unknown"),
        ({"name": 1}, "the body.name"),
        ({"name": "a", "crs": "EPSG:0"}, "EPSG:0"),
        ({"name": "a", "ground_plane": "maybe"}, "the body.ground_plane"),
        ({"name": "a", "options": {"merge_vertices": 1}}, "the body.options.merge_vertices"),
        ({"name": "a", "files": "s3://bucket"}, "files"),
    ],
)
def test_wrong_bodies_are_bad_requests(empty: Api, body: object, detail: str) -> None:
    assert detail in empty.post("/scenes", body, 400)["detail"]
    assert empty.get("/scenes")["scenes"] == []


@pytest.mark.parametrize("body", [b"", b"[]", b"null", b"{", b"[" * 60_000, b'{"name": NaN}', b"\xff", b'{"a":' * 9_999 + b"1" + b"}" * 9_999])
def test_bodies_that_are_not_json_objects_are_bad_requests(empty: Api, body: bytes) -> None:
    empty.send("POST", "/scenes", 400, content=body, headers={"content-type": "application/json"})


def test_body_needs_the_media_type_and_is_limited(empty: Api) -> None:
    empty.send("POST", "/scenes", 400, content=b'{"name": "a"}', headers={"content-type": "text/plain"})
    empty.send("POST", "/scenes", 400, content=b" " * ((1 << 20) - 1), headers={"content-type": "application/json"})
    empty.send("POST", "/scenes", 413, content=b" " * ((1 << 20) + 1), headers={"content-type": "application/json"})


@pytest.mark.parametrize(
    "query", ["limit=0", "limit=1001", "limit=-1", "limit=x", "limit=١", "limit=1e2", "limit=", "limit=1&limit=2", "unknown=1", "limit=" + "9" * 400]
)
def test_wrong_parameters_are_bad_requests(api: Api, query: str) -> None:
    api.get(f"/scenes?{query}", 400)


def test_renderings_are_public_and_described(api: Api) -> None:
    listed = api.get("/renderings", token=None)["renderings"]
    assert [item["name"] for item in listed] == ["tea"]
    assert api.get("/renderings/tea", token=None) == listed[0]
    assert (listed[0]["views"], listed[0]["levels"], listed[0]["res_m"]) == (["0-45", "45-22.5"], 5, 0.1)
    assert api.get("/renderings?scene=nothing")["renderings"] == []
    assert api.get("/renderings/nothing", 404, token=None)["detail"] == "not found", "visitors do not learn what exists"


def test_texts_and_start_view_of_a_rendering_change(api: Api) -> None:
    change = {"title": "Harbour", "start_view": [45, 22.5]}
    found = api.send("PATCH", "/renderings/tea", 200, json=change).json()
    assert (found["title"], found["attribution"], found["start_view"]) == ("Harbour", "© City of Tea", "45-22.5")
    assert api.get("/renderings/tea") == found
    assert json.loads(api.workspace.manifest_path("tea").read_text())["start"]["view"] == "45-22.5"
    for wrong in ({}, {"start_view": [10, 10]}, {"title": 3}, {"name": "x"}):
        assert api.send("PATCH", "/renderings/tea", 400, json=wrong)
    assert api.send("PATCH", "/renderings/none", 404, json=change)


def test_jobs_are_counted_and_failures_have_reasons(api: Api) -> None:
    catalogue = api.workspace.open_catalogue()
    catalogue.plan("tea", [PlannedJob("0-45", BlockId(1, x, 0), "base", x, "k", None) for x in range(3)])
    for _ in range(2 * MAX_ATTEMPTS):
        lease = catalogue.lease("tea", "w")
        assert lease is not None
        catalogue.fail(lease, verbatim("too dark")) if lease.block.x else catalogue.release(lease)
    catalogue.close()
    jobs = api.get("/renderings/tea/jobs")
    assert (jobs["complete"], sum(jobs["counts"].values())) == (False, 3)
    failures = api.get("/renderings/tea/failures?limit=1")
    assert failures["total"] == jobs["counts"]["quarantined"]
    if failures["total"]:
        assert (failures["failures"][0]["reason"], failures["failures"][0]["attempts"]) == ("too dark", MAX_ATTEMPTS)
    api.get("/renderings/nothing/jobs", 404)


def test_operations_are_asked_for_listed_cancelled_and_retried(api: Api) -> None:
    asked = api.send("POST", "/operations", 202, json={"kind": "build", "target": "town"})
    id = asked.json()["id"]
    assert asked.headers["location"] == f"operations/{id}"
    assert (asked.json()["asked_by"], asked.json()["state"]) == ("anna", "waiting")
    others = [api.post("/operations", {"kind": "publish", "target": "tea", "arguments": {"folder": "out"}}, 202)["id"] for _ in range(3)]
    page = api.get("/operations?limit=2")
    assert [item["id"] for item in page["operations"]] == [others[2], others[1]]
    rest = api.get(f"/operations?limit=2&before={page['next']}")
    assert ([item["id"] for item in rest["operations"]], rest.get("next")) == ([others[0], id], None)
    assert [item["id"] for item in api.get("/operations?target=town")["operations"]] == [id]
    assert len(api.get("/operations?scene=town")["operations"]) == 4
    assert api.post(f"/operations/{id}/cancel", status=202)["state"] == "cancelled"
    assert [item["id"] for item in api.get("/operations?state=cancelled,failed")["operations"]] == [id]
    assert api.post(f"/operations/{id}/retry", status=202)["state"] == "waiting"
    assert "only failed and cancelled" in api.post(f"/operations/{id}/retry", status=400)["detail"]
    assert api.get(f"/operations/{id}")["kind"] == "build"
    assert api.get(f"/operations/{id}/log") == {"lines": [], "next": 0}
    for path in ("/operations/999", "/operations/x", "/operations/999/log"):
        api.get(path, 404)
    api.get("/operations?state=lost", 400)


@pytest.mark.parametrize(
    ("body", "status"),
    [
        ({"kind": "destroy", "target": "town"}, 400),
        ({"kind": "build"}, 400),
        ({"kind": "build", "target": "nothing"}, 404),
        ({"kind": "render", "target": "town"}, 404),
        ({"kind": "build", "target": "town", "arguments": {"workers": 0}}, 400),
        ({"kind": "build", "target": "town", "arguments": []}, 400),
        ({"kind": "import", "target": "town", "arguments": {"files": ["../../etc"]}}, 404),
        ({"kind": "import", "target": "town", "arguments": {"paths": ["/etc/passwd"]}}, 400),
        ({"kind": "publish", "target": "tea", "arguments": {"folder": "../x"}}, 400),
        ({"kind": "remove", "target": "town", "arguments": {"what": "scene"}}, 400),
        ({"kind": "remove", "target": "../town", "arguments": {"what": "scene"}}, 400),
    ],
)
def test_wrong_operations_are_refused(api: Api, body: object, status: int) -> None:
    api.post("/operations", body, status)
    assert api.get("/operations")["operations"] == []


def test_unknown_paths_and_methods_are_problems(api: Api) -> None:
    api.get("/nothing", 404, token=None)
    response = api.send("DELETE", "/scenes", 405)
    assert "GET" in response.headers["allow"]
    html = api.client.get(f"{ROOT}/scenes", headers={"accept": "text/html"})
    assert (html.status_code, html.headers["content-type"]) == (401, PROBLEM), "no redirect to the form of the sign-in"


def test_a_town_from_upload_to_published_map(empty: Api) -> None:
    """The way of a program: scene, upload, import, rendering, estimate, render, publish, remove."""

    def do(kind: str, target: str = "town", **arguments) -> dict[str, object]:
        asked = empty.post("/operations", {"kind": kind, "target": target, "arguments": arguments}, 202)
        catalogue = empty.workspace.open_catalogue()
        OperationWorker(empty.workspace, catalogue, poll_s=0.05).run(forever=False)
        catalogue.close()
        ended = empty.get(f"/operations/{asked['id']}")
        log = empty.get(f"/operations/{asked['id']}/log")
        assert ended["state"] == OperationState.DONE, log
        last = log["lines"][-1]
        assert (last["text"], last["text_code"]) == (f"done: {ended['message']}", "operation-done")
        assert last["text_values"]["message"] == {"code": ended["message_code"], "values": ended["message_values"]}
        assert empty.get(f"/operations/{asked['id']}/log?after={log['next']}") == {"lines": [], "next": log["next"]}
        return ended

    assert empty.post("/scenes", {"name": "town", "crs": "EPSG:999999"}, 400)["code"] == "crs-unusable"
    empty.post("/scenes", {"name": "town"}, 201)
    uploads, data = Uploads(empty.workspace.root / "uploads"), house(0, 0, 9).encode()
    upload = uploads.create("anna", "hut.obj", len(data))
    with uploads.write(upload.id, "anna", 0) as writer:
        writer.write(data)
    body = {"scene": "town", "name": "town", "views": [[0, 45]], "res_m": 0.1, "layers": ["color", "id"]}
    do("import", files=[upload.id])
    assert "build it first" in empty.post("/renderings", body, 400)["detail"]
    assert [(item["name"], item["file"], item["triangles"]) for item in empty.get("/scenes/town/assets")["assets"]] == [("hut", "hut.obj", 12)]
    assert empty.get("/scenes/town/assets/hut")["report"]["triangles"] == 12
    empty.get("/scenes/town/assets/none", 404)
    do("build")
    scene = empty.get("/scenes/town")
    assert (scene["built"], len(scene["origin"])) == (True, 3)
    assert empty.post("/renderings", body, 201)["views"] == ["0-45"]
    empty.post("/renderings", body, 400)
    empty.post("/renderings", {**body, "name": "other", "layers": ["color", "noon=picture"], "sun": [180, 45], "levels": 2}, 400)
    other = {**body, "name": "other", "layers": ["color", "noon=picture"], "sun": [180, 45]}
    assert [layer["name"] for layer in empty.post("/renderings", other, 201)["layers"]] == ["color", "noon"]
    estimate = empty.get("/renderings/town/estimate?workers=2")
    assert (estimate["workers"], estimate["open_tiles"] > 0) == (2, True)
    do("render")
    jobs = empty.get("/renderings/town/jobs")
    assert jobs["complete"]
    do("publish")
    assert (empty.workspace.root / "published" / "town" / "index.html").is_file()
    do("remove", what="published", folder="town")
    assert not (empty.workspace.root / "published" / "town").exists()
    do("publish")
    asked = {"kind": "remove", "target": "town", "arguments": {"what": "scene", "with_renderings": True}}
    assert "scene town: is published in published/town" in empty.post("/operations", asked, 400)["detail"]
    message = do("remove", what="scene", with_renderings=True, folders=["town"])["message"]
    assert str(message).startswith("removed scene town with 1 file, 2 renderings, 1 published folder, ")
    assert not (empty.workspace.root / "published" / "town").exists()
    assert empty.get("/scenes")["scenes"] == []


def test_docs_list_every_route_with_its_role(api: Api) -> None:
    text = (Path(__file__).parents[2] / "docs" / "api.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+) (/[^`]+)` \| (\w*) ?\|", text, re.MULTILINE)
    described = [
        (method.upper(), path, each.get("description", "").removeprefix("Needs the role ").rstrip("."))
        for path, methods in api.document["paths"].items()
        for method, each in methods.items()
    ]
    assert sorted(rows) == sorted(described)
