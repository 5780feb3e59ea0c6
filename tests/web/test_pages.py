import html
import json
import os
import re
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

import pytest
from PIL import Image

from map3d.catalogue import SceneRecord
from map3d.errors import AlreadyExists, BadRequest, Corrupt, LimitExceeded, Map3dError, NotFound, StoreError
from map3d.registry import NewObject, Registry
from map3d.tiles import viewer_files
from map3d.web import create_app
from map3d.web.http.http_errors import status_of
from map3d.web.http.settings import ServerSettings
from tests.web.conftest import Client
from tests.web.workspaces import rendering_record


@pytest.fixture
def built_viewer(tmp_path, monkeypatch):
    """Replaces the viewer's files, which may not be built."""
    folder = tmp_path / "package" / "viewer"
    (folder / "assets").mkdir(parents=True)
    (folder / "index.html").write_text("<!doctype html><script src=map3d.js></script>")
    (folder / "assets" / "worker.js").write_text("// worker")
    monkeypatch.setattr(viewer_files, "files", lambda _: folder.parent)
    return folder


def test_the_public_routes_are_there(client):
    assert {"pages.home", "pages.renderings", "pages.view", "pages.icon", "documents.manifest", "pages.static"} <= {
        rule.name for rule in client.app.views.rules
    }


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_other_methods_are_405(client, method):
    for rule in client.app.views.rules:
        path = re.sub("{[^}]*}", "x", rule.path)
        if not any(method == other.method for other in client.app.views.rules if re.sub("{[^}]*}", "x", other.path) == path):
            response = client.request(method, path)
            assert response.status_code == 405, rule
            assert response.headers["cache-control"] == "no-store"


def test_the_manifest_is_served_as_stored(client, workspace):
    response = client.get("/tiles/tea/rendering.json")
    assert response.content == workspace.manifest_path("tea").read_bytes()
    assert response.headers["content-type"] == "application/json"
    assert response.headers["cache-control"] == "no-cache"
    assert response.headers["access-control-allow-origin"] == "*"
    assert client.get("/tiles/tea/rendering.json", headers={"if-none-match": response.headers["etag"]}).status_code == 304
    assert client.get("/view/tea/rendering.json").content == response.content


@pytest.mark.parametrize(
    "path",
    ["rendering.json", "objects/0.json", "objects/search.json", "objects/attributes.json", "objects/columns/x.json", "0-45/color/0/0/0", "nonsense"],
)
def test_any_origin_may_read_documents_and_errors(client, path):
    for base, status in (("/tiles/tea", (200, 204, 404)), ("/tiles/nowhere", (404,))):
        response = client.get(f"{base}/{path}")
        assert response.status_code in status
        assert response.headers["access-control-allow-origin"] == "*"


@pytest.mark.parametrize("base", ["/tiles/tea", "/view/tea"])
def test_objects_are_served_by_shard(client, base):
    response = client.get(f"{base}/objects/0.json")
    value = response.json()
    assert (value["map3d"], value["version"], value["shard"]) == ("objects", 1, 0)
    assert value["objects"]["1"]["name"] == "House <1>"
    assert value["objects"]["1"]["attributes"] == {"address": "Main Street 1", "height": 9.5}
    assert value["objects"]["2"]["parent"] == 1
    assert response.headers["access-control-allow-origin"] == "*"
    assert client.get(f"{base}/objects/0.json", headers={"if-none-match": response.headers["etag"]}).status_code == 304


def test_new_objects_are_found_immediately(client, workspace):
    before = client.get("/tiles/tea/objects/search.json").json()["entries"]
    with Registry(workspace.registry_path("town")) as registry:
        registry.put_asset("more", [NewObject("Tower", "building", box=((0.0, 0.0, 0.0), (2.0, 2.0, 50.0)))])
        assert len(client.get("/tiles/tea/objects/search.json").json()["entries"]) == len(before) + 1
    assert client.get("/tiles/tea/objects/search.json").json()["entries"][1] == [4, "Tower", [1.0, 1.0, 50.0]]


def test_large_documents_are_compressed_on_request(client, workspace):
    with Registry(workspace.registry_path("town")) as registry:
        registry.put_asset("more", [NewObject(f"House {n}", "building", box=((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))) for n in range(100)])
    plain, packed = (client.get("/tiles/tea/objects/0.json", headers={"accept-encoding": name}) for name in ("identity", "gzip"))
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert int(packed.headers["content-length"]) < int(plain.headers["content-length"]) / 5
    assert plain.json() == packed.json()
    assert plain.headers["vary"] == packed.headers["vary"] == "Accept-Encoding"
    assert client.get("/tiles/tea/objects/0.json", headers={"if-none-match": packed.headers["etag"]}).status_code == 304


def test_modules_have_a_javascript_media_type(client, built_viewer):
    (built_viewer / "map3d.module.js").write_text("export {}")
    assert "javascript" in client.get("/view/tea/map3d.module.js").headers["content-type"]
    assert client.get("/view/tea/none.module.js").status_code == 404


def test_the_viewers_files_are_compressed_on_request(client, built_viewer):
    text = "export const a = 1;\n" * 500
    (built_viewer / "map3d.module.js").write_text(text)
    plain, packed = (client.get("/view/tea/map3d.module.js", headers={"accept-encoding": name}) for name in ("identity", "gzip"))
    assert plain.text == packed.text == text
    assert "content-encoding" not in plain.headers
    assert packed.headers["content-encoding"] == "gzip"
    assert int(packed.headers["content-length"]) < len(text) / 20
    assert plain.headers["vary"] == packed.headers["vary"] == "Accept-Encoding"
    for response in (plain, packed):
        again = client.get("/view/tea/map3d.module.js", headers={"if-none-match": response.headers["etag"]})
        assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize(("asked", "start", "stop"), [("bytes=0-9", 0, 10), ("bytes=9990-", 9990, None), ("bytes=-7", -7, None)])
def test_a_range_of_a_file_is_not_compressed(client, built_viewer, asked, start, stop):
    text = "0123456789" * 1000
    (built_viewer / "map3d.module.js").write_text(text)
    part = client.get("/view/tea/map3d.module.js", headers={"range": asked, "accept-encoding": "gzip"})
    assert (part.status_code, part.text) == (206, text[start:stop])
    assert "content-encoding" not in part.headers
    assert part.headers["content-range"].endswith("/10000")
    assert client.get("/view/tea/map3d.module.js", headers={"range": "bytes=10000-"}).status_code == 416
    assert client.request("HEAD", "/view/tea/map3d.module.js", headers={"range": asked}).status_code == 200


@pytest.mark.parametrize(
    ("accept", "html"),
    [
        ("text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8", True),
        ("text/html", True),
        ("TEXT/HTML; q=1.0", True),
        ("*/*", False),
        ("", False),
        ("application/json, text/html", False),
        ("text/html;q=0", False),
        ("text/html;q=x", False),
    ],
)
def test_browsers_get_errors_as_pages(client, accept, html):
    response = client.get("/view/none/", headers={"accept": accept})
    assert (response.status_code, response.headers["content-type"].startswith("text/html")) == (404, html)


def test_a_shard_without_objects_is_empty(client):
    assert client.get("/tiles/tea/objects/7.json").json() == {"map3d": "objects", "version": 1, "shard": 7, "objects": {}}


@pytest.mark.parametrize("base", ["/tiles/tea", "/view/tea"])
def test_objects_are_found_by_label_and_parts_lead_to_them(client, base):
    value = client.get(f"{base}/objects/search.json").json()
    assert value == {"map3d": "search", "version": 1, "entries": [[1, "House <1>, Main Street 1", [5.0, 10.0, 9.5], "roof"]]}


@pytest.mark.parametrize("base", ["/tiles/tea", "/view/tea"])
def test_attributes_are_served_by_column(client, base):
    index = client.get(f"{base}/objects/attributes.json").json()
    assert [(row["of"], row["name"]) for row in index["attributes"]] == [
        ("object", "class"),
        ("object", "asset"),
        ("attributes", "address"),
        ("attributes", "height"),
    ]
    response = client.get(f"{base}/objects/columns/{index['attributes'][3]['column']}.json")
    assert response.json() == {"map3d": "column", "version": 1, "name": "height", "of": "attributes", "ids": [1, 2], "values": [9.5, 9.5]}
    assert response.headers["access-control-allow-origin"] == "*"


@pytest.mark.parametrize("column", ["0" * 16, "0" * 15, "..%2fsearch", "ABCDEF0123456789", "x" * 5000])
def test_an_unknown_column_is_404(client, column):
    assert client.get(f"/tiles/tea/objects/columns/{column}.json").status_code == 404


@pytest.mark.parametrize("shard", ["01", "-1", "x", "99999999", "1e3", "%D9%A1"])
def test_an_invalid_shard_is_404(client, shard):
    assert client.get(f"/tiles/tea/objects/{shard}.json").status_code == 404


def test_a_scene_without_objects_is_404(client, workspace):
    workspace.registry_path("town").unlink()
    assert client.get("/tiles/tea/objects/0.json").status_code == 404
    assert not workspace.registry_path("town").exists()


@pytest.mark.parametrize("path", ["/tiles/none/rendering.json", "/tiles/..%2f/rendering.json", "/tiles/A/rendering.json", "/nothing", "/view/none/"])
def test_missing_pages_are_404_and_never_cached(client, path):
    response = client.get(path)
    assert (response.status_code, response.headers["cache-control"]) == (404, "no-store")


def test_home_redirects_to_the_only_rendering(client):
    for method in ("GET", "HEAD"):
        response = client.request(method, "/")
        assert (response.status_code, response.headers["location"], response.headers["cache-control"]) == (302, "view/tea/", "no-store")


def test_home_lists_several_renderings(client, workspace):
    home = workspace.open_catalogue()
    home.create_rendering(rendering_record("new"))
    home.close()
    response = client.get("/")
    assert (response.status_code, response.headers["cache-control"]) == (200, "no-store")
    assert response.text == client.get("/renderings").text


def test_home_lists_a_single_rendering_without_tiles(client, workspace):
    workspace.manifest_path("tea").unlink()
    response = client.get("/")
    assert response.status_code == 200
    assert "map3d render tea" in response.text


def test_the_list_describes_renderings(client, workspace):
    os.utime(workspace.manifest_path("tea"), (1_790_000_000, 1_790_000_000))
    text = client.get("/renderings").text
    assert '<a href="view/tea/">' in text
    assert "2 views · 4 layers · " in text
    assert "Complete" in text
    assert '<time datetime="2026-09-21T14:13:20Z"' in text
    assert "21 September 2026" in text
    assert "© City of Tea" in text


def test_an_incomplete_rendering_is_marked(client, workspace):
    path = workspace.manifest_path("tea")
    path.write_text(path.read_text().replace('"complete": true', '"complete": false'))
    assert ">Incomplete<" in client.get("/renderings").text


def test_the_list_shows_a_picture_of_each_rendering_with_tiles(client):
    (picture,) = re.findall('<img class="preview" src="([^"]+)"', client.get("/renderings").text)
    response = client.get(f"/{html.unescape(picture)}")
    assert (response.status_code, response.headers["content-type"]) == (200, "image/jpeg")


@pytest.mark.parametrize(("file", "media_type"), [("favicon.svg", "image/svg+xml"), ("favicon.ico", "image/")])
def test_icons_are_served(client, file, media_type):
    response = client.get(f"/{file}")
    assert (response.status_code, response.headers["content-type"].startswith(media_type)) == (200, True)


def test_the_viewers_page_embeds_the_same_icon():
    page = (Path(__file__).parents[2] / "viewer" / "page" / "index.html").read_text()
    (embedded,) = re.findall('<link rel="icon" href="data:image/svg\\+xml,([^"]+)">', page)
    icon = files("map3d") / "web" / "static" / "favicon.svg"
    assert unquote(embedded).replace("'", '"') == icon.read_text().replace("\n", "")


def test_titles_are_escaped(client):
    text = client.get("/renderings").text
    assert "Tea &lt;time&gt;" in text
    assert "<time>" not in text


def test_renderings_without_tiles_or_with_a_damaged_manifest_are_listed(client, workspace):
    home = workspace.open_catalogue()
    home.create_rendering(rendering_record("new"))
    home.close()
    workspace.manifest_path("tea").write_text("{")
    text = client.get("/renderings").text
    assert "Not rendered yet" in text
    assert "Unreadable" in text
    assert "<h2><a href" not in text


def test_a_workspace_without_renderings_says_what_to_do(tmp_path):
    from map3d.catalogue import Workspace

    home = Workspace(tmp_path).create().open_catalogue()
    home.create_scene(SceneRecord("town"))
    home.close()
    client = Client(create_app(tmp_path))
    assert "map3d create-rendering" in client.get("/").text
    client.close()


def test_no_page_has_inline_script_or_style(client, built_viewer):
    for path in ("/", "/renderings", "/view/tea/", "/healthz"):
        policy = client.get(path).headers["content-security-policy"]
        assert "default-src 'self'" in policy
        assert "unsafe" not in policy
        assert client.get(path).headers["x-content-type-options"] == "nosniff"
    assert not re.search(r"<style|style=|<script(?![^>]*src)| on\w+=", client.get("/renderings").text)


def test_maps_may_be_framed_and_other_pages_only_by_this_server(workspace, built_viewer):
    client = Client(create_app(workspace, ServerSettings(frame_ancestors="https://example.org")))
    ancestors = {path: client.get(path).headers["content-security-policy"].rpartition("frame-ancestors ")[2] for path in ("/view/tea/", "/sign-in")}
    assert ancestors == {"/view/tea/": "https://example.org", "/sign-in": "'self'"}
    client.close()


def test_the_viewers_page_and_files_are_served(client, built_viewer):
    assert client.get("/view/tea/").text.startswith("<!doctype html>")
    assert client.get("/view/tea").status_code in (301, 308)
    assert client.get("/view/tea/assets/worker.js").text == "// worker"


@pytest.mark.parametrize(
    "file", ["..%2f..%2fsecret", "..%2fsecret", "%2fetc%2fpasswd", "assets", "none.js", "assets%2f..%2f..%2fsecret", "%00", "x" * 5000]
)
def test_nothing_outside_the_viewer_is_served(client, built_viewer, file):
    (built_viewer.parent / "secret").write_text("secret")
    assert client.get(f"/view/tea/{file}").status_code == 404


def test_a_missing_viewer_is_503_with_advice(client, tmp_path, monkeypatch):
    monkeypatch.setattr(viewer_files, "files", lambda _: tmp_path / "nowhere")
    response = client.get("/view/tea/")
    assert (response.status_code, response.headers["cache-control"]) == (503, "no-store")
    assert "make build" in response.text


def test_the_health_check_answers(client):
    response = client.get("/healthz")
    assert (response.status_code, response.text) == (200, "ok\n")


def test_an_unexpected_error_is_500_without_details(client, monkeypatch):
    monkeypatch.setattr("map3d.web.pages.page_routes.catalogue", lambda: 1 / 0)
    response = client.get("/renderings")
    assert (response.status_code, response.text) == (500, "internal server error; see the server log\n")


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (NotFound("x"), 404), (BadRequest("x"), 400), (AlreadyExists("x"), 409), (LimitExceeded("x"), 413), (StoreError("/p"), 503),
        (Corrupt("/p"), 500), (Map3dError("/p"), 500), (ValueError("/p"), 500),
    ],
)  # fmt: skip
def test_statuses_of_exceptions(error, status):
    got, text = status_of(error)
    assert got == status
    assert "/p" not in text


def test_a_missing_workspace_is_not_found(tmp_path):
    with pytest.raises(NotFound, match="create-scene"):
        create_app(tmp_path / "none")


def test_the_served_manifest_is_json(client):
    assert json.loads(client.get("/tiles/tea/rendering.json").text)["name"] == "tea"


def test_the_page_of_a_rendering_has_its_title_and_picture(client, built_viewer):
    (built_viewer / "index.html").write_text("<!doctype html>\n<head>\n<title>map3d</title>\n</head>\n")
    page = client.get("/view/tea/")
    assert "<title>Tea &lt;time&gt;</title>" in page.text
    (picture,) = re.findall(r'<meta property="og:image" content="([^"]*)">', page.text)
    assert picture.startswith("http")
    assert '<meta name="twitter:card" content="summary_large_image">' in page.text
    assert page.headers["cache-control"] == "no-cache"
    assert client.get("/view/tea/", headers={"if-none-match": page.headers["etag"]}).status_code == 304
    answer = client.get(picture)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/jpeg")
    with Image.open(BytesIO(answer.content)) as opened:
        assert opened.size == (1200, 630)
    assert client.get(picture, headers={"if-none-match": answer.headers["etag"]}).status_code == 304


def test_an_empty_rendering_has_a_page_without_picture(client, workspace, built_viewer):
    workspace.manifest_path("tea").unlink()
    page = client.get("/view/tea/")
    assert (page.status_code, "og:image" in page.text) == (200, False)
    assert client.get("/view/tea/preview.jpg").status_code == 404
