"""Manifests from memory are those that the view function would send."""

import asyncio
import os

import pytest

from map3d.web.tiles.manifest_route import ManifestRoute
from tests.web.workspaces import rendering_record

PATHS = ["/tiles/tea/rendering.json", "/view/tea/rendering.json"]
HEADERS = [{}, {"accept-encoding": "gzip"}, {"accept-encoding": "identity"}, {"accept-encoding": "gzip;q=0"}, {"accept-encoding": "br, gzip"}]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("method", ["GET", "HEAD"])
@pytest.mark.parametrize("headers", HEADERS, ids=[str(number) for number in range(len(HEADERS))])
def test_status_headers_and_text_are_those_of_the_view_function(client, monkeypatch, path, method, headers):
    asked = {"accept-encoding": "", **headers}
    with monkeypatch.context() as patch:
        patch.setattr(client.app.manifests, "answers", lambda _scope: False)
        expected = client.request(method, path, headers=asked)
    for _ in range(2):
        response = client.request(method, path, headers=asked)
        assert response.status_code == expected.status_code == 200
        for name in ("etag", "cache-control", "vary", "content-type", "content-encoding", "content-length", "access-control-allow-origin"):
            assert response.headers.get(name) == expected.headers.get(name), name
        assert response.text == (client.get(path).text if method == "GET" else "")
    again = client.request(method, path, headers={"if-none-match": response.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")


def test_a_new_manifest_is_served_at_once(client, workspace):
    before = client.get(PATHS[0])
    path = workspace.manifest_path("tea")
    draft = path.with_suffix(".new")
    draft.write_bytes(before.content.replace(b'"complete": true', b'"complete": false'))
    os.replace(draft, path)
    after = client.get(PATHS[0], headers={"if-none-match": before.headers["etag"]})
    assert (after.status_code, after.json()["complete"]) == (200, False)


@pytest.mark.parametrize("name", ["none", "..", "%2e%2e", "TEA", "te%2fa", "a" * 5000, "%00"])
def test_other_names_are_left_to_the_view_function(client, name):
    assert client.get(f"/tiles/{name}/rendering.json").status_code == 404
    assert len(client.app.manifests._known) == 0


def test_a_manifest_outside_the_workspace_is_left_to_the_view_function(client, workspace, tmp_path):
    catalogue = workspace.open_catalogue()
    record = rendering_record("far")
    catalogue.create_rendering(type(record)(**{**vars(record), "options": {"tiles": (tmp_path / "objects").as_uri()}}))
    catalogue.close()
    (tmp_path / "objects" / "far").mkdir(parents=True)
    (tmp_path / "objects" / "far" / "rendering.json").write_bytes(workspace.manifest_path("tea").read_bytes())
    assert client.get("/tiles/far/rendering.json").json()["name"] == "tea"
    assert len(client.app.manifests._known) == 0


def test_other_methods_are_refused(client):
    assert client.request("POST", PATHS[0]).status_code == 405


def test_requests_at_the_same_time_share_one_reading_and_an_unchanged_file_is_not_read_again(workspace, monkeypatch):
    monkeypatch.setattr("map3d.web.tiles.manifest_route.RECHECK_S", -1.0)
    route, readings, bodies = ManifestRoute(workspace, None), [], []
    read = route._read
    monkeypatch.setattr(route, "_read", lambda name, known: readings.append(name) or read(name, known))
    scope = {"type": "http", "method": "GET", "path": PATHS[0], "headers": []}

    async def send(message):
        if message["type"] == "http.response.body":
            bodies.append(message["body"])

    async def ask_twice():
        for _ in range(2):
            await asyncio.gather(*(route(scope, None, send) for _ in range(20)))

    asyncio.run(ask_twice())
    assert readings == ["tea", "tea"]
    assert len(bodies) == 40
    assert all(body is bodies[0] for body in bodies)
    assert route._readings == {}
