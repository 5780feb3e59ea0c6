"""Requests that are malformed, huge or meant to fill caches are refused at once; ranges; texts that are too long."""

import shutil
from dataclasses import replace

import pytest

from map3d.errors import NotFound
from map3d.publish.page_head import MAX_DESCRIPTION, MAX_TITLE
from map3d.tiles import viewer_files
from map3d.types import TileId
from map3d.web.server.views import THREADS
from tests.web.workspaces import ZMAX, tile_bytes

URL = f"/tiles/tea/0-45/color/{ZMAX}/7/7"
HUGE = "9" * 60_000

HOSTILE = [
    f"/tiles/tea/0-45/color/{HUGE}/0/0", f"/tiles/tea/0-45/color/4/{HUGE}/0", "/tiles/tea/0-45/color/4/-1/0", "/tiles/tea/0-45/color/4/+1/0",
    "/tiles/tea/0-45/color/4/1.0/0", "/tiles/tea/0-45/color/4/1e1/0", "/tiles/tea/0-45/color/4/NaN/0", "/tiles/tea/0-45/color/4/Infinity/0",
    "/tiles/tea/0-45/color/4/\u0661/0", "/tiles/tea/0-45/color/4/\uff11/0", "/tiles/tea/0-45/color/4/\u00b2/0", "/tiles/tea/0-45/color/4/0x1/0",
    "/tiles/tea/0-45/color/4/1_0/0", "/tiles/tea/0-45/color/4/ 1/0", "/tiles/tea/0-45/color/4/01/0", "/tiles/tea/0-45/color/27/0/0",
    "/tiles/tea/0-45/color/4294967296/0/0", "/tiles/tea/0-45/color/4/16/0", "/tiles/tea/NaN-45/color/0/0/0", "/tiles/tea/-0-45/color/0/0/0",
    "/tiles/tea/0-NaN/color/0/0/0", "/tiles/tea/0-1e999/color/0/0/0", "/tiles/tea/360-45/color/0/0/0", "/tiles/tea/0.0-45/color/0/0/0",
    f"/tiles/{HUGE}/0-45/color/0/0/0", f"/tiles/tea/{HUGE}/color/0/0/0", f"/tiles/tea/0-45/{HUGE}/0/0/0", "/tiles/t\u00e9a/0-45/color/0/0/0",
    "/tiles/tea/objects/-1.json", "/tiles/tea/objects/NaN.json", f"/tiles/tea/objects/{HUGE}.json", "/tiles/tea/objects/\u0661.json",
    "/tiles/tea/objects/4294967296.json", "/tiles/tea/objects/columns/NaN.json", f"/view/{HUGE}/", "/view/\u0130/", "/view/tea/../../../etc/passwd",
]  # fmt: skip


@pytest.mark.parametrize("path", HOSTILE, ids=[f"{number}" for number in range(len(HOSTILE))])
def test_hostile_parameters_are_refused(client, path):
    response = client.get(path)
    assert response.status_code in (400, 404)
    assert response.headers["cache-control"] == "no-store"
    assert len(client.app.tiles.cache) == 0


ALIASES = ["?v=1", "?v=01", "?v=1&v=1", "?v=1&a=2", "?a=2&v=1", "?v=%31", "?v=+1", "?v=1;", "?v=\u0661", "?V=1", "?v=1.0", "", "?", "?x=1"]


def test_a_tile_has_one_key_in_the_cache(client):
    for base in ("/tiles/tea", "/view/tea", "/tiles/%74ea", "/tiles/te%61"):
        for query in ALIASES:
            response = client.get(f"{base}/0-45/color/{ZMAX}/7/7{query}")
            assert (response.status_code, response.content) == (200, tile_bytes("0-45", "color", TileId(ZMAX, 7, 7)))
    assert len(client.app.tiles.cache) == 1


def test_a_flood_of_errors_leaves_the_cache_empty(client):
    for number in range(200):
        client.get(f"/tiles/tea/0-45/color/4/{number + 16}/0?v=1")
        client.get(f"/tiles/tea{number}/0-45/color/4/0/0?v=1")
    assert len(client.app.tiles.cache) == 0


@pytest.mark.parametrize(
    ("asked", "start", "stop"),
    [
        ("bytes=0-0", 0, 1),
        ("bytes=3-9", 3, 10),
        ("bytes=5-", 5, None),
        ("bytes=-4", -4, None),
        ("bytes=0-999999", 0, None),
        ("bytes=-999999", 0, None),
    ],
)
@pytest.mark.parametrize("query", ["", "?v=1"])
def test_a_range_of_a_tile(client, asked, start, stop, query):
    whole = client.get(URL + query)
    assert whole.headers["accept-ranges"] == "bytes"
    part = client.get(URL + query, headers={"range": asked})
    expected = whole.content[start:stop]
    first = start % len(whole.content)
    assert (part.status_code, part.content) == (206, expected)
    assert part.headers["content-range"] == f"bytes {first}-{first + len(expected) - 1}/{len(whole.content)}"
    assert part.headers["content-length"] == str(len(expected))
    assert (part.headers["etag"], part.headers["cache-control"]) == (whole.headers["etag"], whole.headers["cache-control"])


@pytest.mark.parametrize("asked", ["bytes=0-1,3-4", "bytes=9-3", "bytes=-", "bytes=a-b", "lines=0-1", "bytes=\u0661-", f"bytes={'9' * 5000}-", ""])
def test_other_ranges_are_ignored(client, asked):
    whole, response = client.get(URL), client.get(URL, headers={"range": asked.encode()})
    assert (response.status_code, response.content) == (200, whole.content)


@pytest.mark.parametrize("asked", ["bytes=999999-", "bytes=999999-9999999", "bytes=-0"])
def test_a_range_outside_the_tile_is_416(client, asked):
    whole, response = client.get(URL), client.get(URL, headers={"range": asked})
    assert (response.status_code, response.headers["cache-control"]) == (416, "no-store")
    assert response.headers["content-range"] == f"bytes */{len(whole.content)}"


def test_a_range_of_a_changed_tile_is_the_whole_tile(client):
    whole = client.get(URL)
    same = client.get(URL, headers={"range": "bytes=0-1", "if-range": whole.headers["etag"]})
    changed = client.get(URL, headers={"range": "bytes=0-1", "if-range": '"other"'})
    matching = client.get(URL, headers={"range": "bytes=0-1", "if-none-match": whole.headers["etag"]})
    assert (same.status_code, changed.status_code, matching.status_code) == (206, 200, 304)


def test_a_head_request_ignores_ranges(client):
    assert client.request("HEAD", URL, headers={"range": "bytes=0-1"}).status_code == 200


def test_a_title_of_five_megabytes_is_cut(client, workspace, tmp_path, monkeypatch):
    folder = tmp_path / "package" / "viewer"
    folder.mkdir(parents=True)
    (folder / "index.html").write_text("<!doctype html>\n<head>\n<title>map3d</title>\n</head>\n")
    monkeypatch.setattr(viewer_files, "files", lambda _: folder.parent)
    catalogue = workspace.open_catalogue()
    record = catalogue.rendering("tea")
    catalogue.create_rendering(replace(record, name="long", title="x" * 5_000_000, attribution="y" * 5_000_000))
    catalogue.close()
    shutil.copytree(workspace.rendering_folder("tea"), workspace.rendering_folder("long"))
    manifest = workspace.manifest_path("long")
    manifest.write_text(manifest.read_text().replace("Tea <time>", "x" * 5_000_000).replace("© City of Tea", "y" * 5_000_000))
    assert len(client.get("/renderings").content) < 100_000
    page = client.get("/view/long/").text
    assert len(page) < 3 * (MAX_TITLE + MAX_DESCRIPTION) + 2000
    assert f"<title>{'x' * (MAX_TITLE - 1)}…</title>" in page


def test_the_server_is_not_ready_when_the_catalogue_is_gone(client, workspace):
    assert client.get("/readyz").status_code == 200
    workspace.catalogue_path.unlink()
    assert client.get("/readyz").status_code == 503
    assert client.get("/healthz").status_code == 200


def test_a_deleted_catalogue_is_not_created_again(client, workspace):
    """Each request may be answered by a thread that opens the catalogue for the first time."""
    assert client.get("/readyz").status_code == 200
    for path in workspace.root.glob("catalogue.sqlite*"):
        path.unlink()
    for _ in range(2 * THREADS):
        assert client.get("/renderings").status_code == 503
        assert client.get("/readyz").status_code == 503
    assert not workspace.catalogue_path.exists()
    with pytest.raises(NotFound, match="restore it from a backup"):
        workspace.open_catalogue()
    assert not workspace.catalogue_path.exists()
