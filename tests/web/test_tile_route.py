import os
import shutil

import pytest

from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.store import content_hash
from map3d.types import BlockId, TileId
from map3d.web import open_stores, tile_route
from tests.web.workspaces import ADDED, LAYERS, OCCUPIED, ZMAX, add_pass, every_tile, put_block, rendering_record, store_shape, tile_bytes

TILE = TileId(ZMAX, 7, 7)
URL = f"/tiles/tea/0-45/color/{ZMAX}/7/7"
IMMUTABLE = "public, max-age=31536000, immutable"


def test_every_tile_comes_as_it_is_stored(client):
    for view in ("0-45", "45-22.5"):
        for layer in LAYERS:
            for tile in every_tile():
                answer = client.get(f"/tiles/tea/{view}/{layer.name}/{tile.z}/{tile.x}/{tile.y}?v=1")
                assert (answer.status_code, answer.content) == (200, tile_bytes(view, layer.name, tile))
                assert answer.headers["content-type"] == layer.media_type
                assert answer.headers["content-length"] == str(len(answer.content))


def test_headers_let_any_origin_read(client):
    headers = client.get(URL).headers
    assert headers["access-control-allow-origin"] == "*"
    assert headers["x-content-type-options"] == "nosniff"


def test_the_viewers_page_finds_tiles_in_its_own_folder(client):
    assert client.get(URL.replace("/tiles/", "/view/") + "?v=1").content == tile_bytes("0-45", "color", TILE)


@pytest.mark.parametrize("again", [1, 2])
def test_a_versioned_tile_is_immutable(client, again):
    for _ in range(again):
        answer = client.get(f"{URL}?v=1")
    assert answer.headers["cache-control"] == IMMUTABLE


@pytest.mark.parametrize("query", ["", "?v=2", "?v=", "?v=x", "?v=01", "?v=1&v=1", "?v=-1", "?v=99999999999", "?V=1"])
def test_without_the_present_version_it_must_be_asked_for_anew(client, query):
    answer = client.get(URL + query)
    assert (answer.status_code, answer.headers["cache-control"]) == (200, "no-cache")


def test_the_etag_is_the_contents_hash(client):
    answer = client.get(URL)
    assert answer.headers["etag"] == f'"{content_hash(answer.content).hex()}"'


@pytest.mark.parametrize("query", ["", "?v=1"])
@pytest.mark.parametrize("wrap", ["{}", "W/{}", '"other", {}', "*"])
def test_what_the_client_has_is_not_sent_again(client, query, wrap):
    etag = client.get(URL + query).headers["etag"]
    answer = client.get(URL + query, headers={"if-none-match": wrap.format(etag)})
    assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", etag)
    assert "cache-control" in answer.headers


def test_another_etag_gets_the_tile(client):
    assert client.get(URL, headers={"if-none-match": '"00"'}).status_code == 200


def test_an_empty_tile_is_204(client):
    answer = client.get("/tiles/tea/0-45/id/4/15/0?v=1")
    assert (answer.status_code, answer.content, answer.headers["cache-control"]) == (204, b"", IMMUTABLE)
    assert client.get("/tiles/tea/0-45/id/4/15/0").headers["cache-control"] == "no-cache"


def test_a_tile_of_a_block_that_is_not_there_yet_is_not_kept(client, workspace):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        store.remove_block(BlockId(1, 0, 0))
    answer = client.get("/tiles/tea/0-45/color/4/0/0?v=1")
    assert (answer.status_code, answer.headers["cache-control"]) == (204, "no-store")
    assert client.get("/tiles/tea/0-45/color/4/0/0?v=1").headers["cache-control"] == "no-store"


@pytest.mark.parametrize("z", ["0", str(ZMAX)])
@pytest.mark.parametrize("method", ["HEAD", "GET"])
def test_head_is_get_without_the_body(client, z, method):
    answer, full = client.request("HEAD", f"/tiles/tea/0-45/color/{z}/0/0"), client.get(f"/tiles/tea/0-45/color/{z}/0/0")
    assert (answer.status_code, answer.content) == (200, b"")
    assert dict(answer.headers) == dict(full.headers)


@pytest.mark.parametrize(
    "path",
    [
        "/tiles/tea/0-45/color/5/0/0", "/tiles/tea/0-45/color/4/16/0", "/tiles/tea/0-45/color/04/0/0", "/tiles/tea/0-45/color/4/-0/0",
        "/tiles/tea/0-45/color/4/0/0.png", "/tiles/tea/0-45/color/4/0/", "/tiles/tea/0-45/color/4/%D9%A1/0", "/tiles/tea/0-45/color/4/1e0/0",
        "/tiles/tea/0-45/nolayer/0/0/0", "/tiles/tea/0-46/color/0/0/0", "/tiles/tea/0-045/color/0/0/0", "/tiles/nothing/0-45/color/0/0/0",
        "/tiles/../0-45/color/0/0/0", "/tiles/%2e%2e/0-45/color/0/0/0", "/tiles/tea/..%2f0-45/color/0/0/0", "/tiles/TEA/0-45/color/0/0/0",
        "/tiles/tea%00/0-45/color/0/0/0", "/tiles/tea/0-45/color/27/0/0", "/tiles/tea/0-45/color/" + "9" * 3000 + "/0/0",
    ],
)  # fmt: skip
def test_what_is_no_tile_is_404_and_never_cached(client, path):
    answer = client.get(path)
    assert answer.status_code == 404
    assert answer.headers.get("cache-control") == "no-store"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"])
def test_tiles_can_only_be_got(client, method):
    answer = client.request(method, URL)
    assert (answer.status_code, answer.headers["allow"]) == (405, "GET, HEAD")


def test_a_new_version_is_served_at_once(client, workspace):
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE)
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt="new")
    new = tile_bytes("0-45", "color", TILE, "new")
    assert client.get(URL).content == new
    answer = client.get(f"{URL}?v=2")
    assert (answer.content, answer.headers["cache-control"]) == (new, IMMUTABLE)


def test_layers_that_were_added_are_served_beside_those_before(client, workspace):
    assert client.get(f"/tiles/tea/0-45/again/{ZMAX}/7/7?v=2").status_code == 404
    add_pass(workspace)
    for layer in ADDED:
        for tile in every_tile():
            answer = client.get(f"/tiles/tea/0-45/{layer.name}/{tile.z}/{tile.x}/{tile.y}?v=2")
            assert (answer.status_code, answer.content) == (200, tile_bytes("0-45", layer.name, tile))
            assert (answer.headers["content-type"], answer.headers["cache-control"]) == (layer.media_type, IMMUTABLE)
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE)


def test_an_added_layer_has_versions_of_its_own(client, workspace):
    add_pass(workspace)
    added = URL.replace("/color/", "/again/")
    assert client.get(f"{added}?v=1").headers["cache-control"] == "no-cache"
    assert client.get(f"{URL}?v=2").headers["cache-control"] == "no-cache"
    with SqliteTileStore(workspace.store_path("tea", "0-45+1")) as store:
        store.remove_block(BlockId(1, 0, 0))
    assert (client.get(added).status_code, client.get(URL).status_code) == (204, 200)


@pytest.mark.parametrize("view", ["0-45+1", "0-45%2B1", "0-45+0", "0-45+"])
def test_a_track_is_no_view(client, workspace, view):
    add_pass(workspace)
    assert client.get(f"/tiles/tea/{view}/again/{ZMAX}/7/7").status_code == 404


def test_a_layer_that_is_not_there_is_told_from_all_that_are(client, workspace):
    add_pass(workspace)
    answer = client.get("/tiles/tea/0-45/other/0/0/0")
    assert (answer.status_code, answer.text) == (404, "no such layer; there are color, normal, id, depth, again, coarse\n")


def test_a_rendering_made_anew_under_its_name_is_noticed(client, workspace, monkeypatch):
    monkeypatch.setattr(open_stores, "RECHECK_S", 0.0)
    assert client.get(f"{URL}?v=1").status_code == 200
    path = workspace.store_path("tea", "0-45")
    fresh = path.with_name("fresh.sqlite")
    with SqliteTileStore.create(fresh, store_shape(rendering_record())) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), salt="other")
    os.replace(fresh, path)
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE, "other")


def test_a_removed_rendering_is_gone(client, workspace, monkeypatch):
    monkeypatch.setattr(open_stores, "RECHECK_S", 0.0)
    assert client.get(f"{URL}?v=1").status_code == 200
    shutil.rmtree(workspace.rendering_folder("tea"))
    assert client.get(f"{URL}?v=1").status_code == 404


def test_an_error_is_told_without_paths_and_not_kept(client, workspace, monkeypatch):
    def fail(*_):
        raise tile_route.status_of.__globals__["StoreError"](f"{workspace.root}: disk I/O error")

    with monkeypatch.context() as broken:
        broken.setattr(SqliteTileStore, "get_tile", fail)
        answer = client.get(f"{URL}?v=1")
    assert (answer.status_code, answer.headers["cache-control"]) == (503, "no-store")
    assert str(workspace.root) not in answer.text
    assert client.get(f"{URL}?v=1").status_code == 200


def test_the_cache_answers_without_the_store(client, monkeypatch):
    client.get(f"{URL}?v=1")
    monkeypatch.setattr(SqliteTileStore, "get_tile", None)
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE)
    assert len(client.app.tiles.cache) == 1


def test_queries_that_differ_do_not_fill_the_cache(client):
    for junk in range(20):
        client.get(f"{URL}?v=1&junk={junk}")
        client.get(f"{URL}?v={junk + 2}")
    assert len(client.app.tiles.cache) == 0
