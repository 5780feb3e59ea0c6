import os
import shutil

import pytest

from map3d.errors import StoreError
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.tiles.tile_store import content_hash
from map3d.types import BlockId, TileId
from map3d.web.http import open_stores
from tests.web.workspaces import ADDED, LAYERS, OCCUPIED, ZMAX, add_pass, every_tile, put_block, rendering_record, store_shape, tile_bytes

TILE = TileId(ZMAX, 7, 7)
URL = f"/tiles/tea/0-45/color/{ZMAX}/7/7"
IMMUTABLE = "public, max-age=31536000, immutable"


def test_every_tile_is_served_as_stored(client):
    for view in ("0-45", "45-22.5"):
        for layer in LAYERS:
            for tile in every_tile():
                response = client.get(f"/tiles/tea/{view}/{layer.name}/{tile.z}/{tile.x}/{tile.y}?v=1")
                assert (response.status_code, response.content) == (200, tile_bytes(view, layer.name, tile))
                assert response.headers["content-type"] == layer.media_type
                assert response.headers["content-length"] == str(len(response.content))


def test_any_origin_may_read_tiles(client):
    headers = client.get(URL).headers
    assert headers["access-control-allow-origin"] == "*"
    assert headers["x-content-type-options"] == "nosniff"


def test_tiles_are_also_in_the_folder_of_the_viewers_page(client):
    assert client.get(URL.replace("/tiles/", "/view/") + "?v=1").content == tile_bytes("0-45", "color", TILE)


@pytest.mark.parametrize("again", [1, 2])
def test_a_versioned_tile_is_immutable(client, again):
    for _ in range(again):
        response = client.get(f"{URL}?v=1")
    assert response.headers["cache-control"] == IMMUTABLE


@pytest.mark.parametrize("query", ["", "?v=2", "?v=", "?v=x", "?v=01", "?v=1&v=1", "?v=-1", "?v=99999999999", "?V=1"])
def test_without_the_current_version_clients_must_revalidate(client, query):
    response = client.get(URL + query)
    assert (response.status_code, response.headers["cache-control"]) == (200, "no-cache")


def test_the_etag_is_the_content_hash(client):
    response = client.get(URL)
    assert response.headers["etag"] == f'"{content_hash(response.content).hex()}"'


@pytest.mark.parametrize("query", ["", "?v=1"])
@pytest.mark.parametrize("wrap", ["{}", "W/{}", '"other", {}', "*"])
def test_a_matching_etag_gets_304(client, query, wrap):
    etag = client.get(URL + query).headers["etag"]
    response = client.get(URL + query, headers={"if-none-match": wrap.format(etag)})
    assert (response.status_code, response.content, response.headers["etag"]) == (304, b"", etag)
    assert "cache-control" in response.headers


def test_a_different_etag_gets_the_tile(client):
    assert client.get(URL, headers={"if-none-match": '"00"'}).status_code == 200


def test_an_empty_tile_is_204(client):
    response = client.get("/tiles/tea/0-45/id/4/15/0?v=1")
    assert (response.status_code, response.content, response.headers["cache-control"]) == (204, b"", IMMUTABLE)
    assert client.get("/tiles/tea/0-45/id/4/15/0").headers["cache-control"] == "no-cache"


def test_a_tile_of_a_missing_block_is_not_stored(client, workspace):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        store.remove_block(BlockId(1, 0, 0))
    response = client.get("/tiles/tea/0-45/color/4/0/0?v=1")
    assert (response.status_code, response.headers["cache-control"]) == (204, "no-store")
    assert client.get("/tiles/tea/0-45/color/4/0/0?v=1").headers["cache-control"] == "no-store"


@pytest.mark.parametrize("z", ["0", str(ZMAX)])
@pytest.mark.parametrize("method", ["HEAD", "GET"])
def test_head_is_get_without_the_body(client, z, method):
    response, full = client.request("HEAD", f"/tiles/tea/0-45/color/{z}/0/0"), client.get(f"/tiles/tea/0-45/color/{z}/0/0")
    assert (response.status_code, response.content) == (200, b"")
    assert dict(response.headers) == dict(full.headers)


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
def test_invalid_tile_urls_are_404_and_never_cached(client, path):
    response = client.get(path)
    assert response.status_code == 404
    assert response.headers.get("cache-control") == "no-store"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS"])
def test_tiles_allow_only_get_and_head(client, method):
    response = client.request(method, URL)
    assert (response.status_code, response.headers["allow"]) == (405, "GET, HEAD")


def test_a_new_version_is_served_at_once(client, workspace):
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE)
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        put_block(store, "0-45", BlockId(1, 0, 0), Occupancy.from_tiles(ZMAX, OCCUPIED), version=2, salt="new")
    new = tile_bytes("0-45", "color", TILE, "new")
    assert client.get(URL).content == new
    response = client.get(f"{URL}?v=2")
    assert (response.content, response.headers["cache-control"]) == (new, IMMUTABLE)


def test_added_layers_are_served(client, workspace):
    assert client.get(f"/tiles/tea/0-45/again/{ZMAX}/7/7?v=2").status_code == 404
    add_pass(workspace)
    for layer in ADDED:
        for tile in every_tile():
            response = client.get(f"/tiles/tea/0-45/{layer.name}/{tile.z}/{tile.x}/{tile.y}?v=2")
            assert (response.status_code, response.content) == (200, tile_bytes("0-45", layer.name, tile))
            assert (response.headers["content-type"], response.headers["cache-control"]) == (layer.media_type, IMMUTABLE)
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE)


def test_an_added_layer_has_its_own_versions(client, workspace):
    add_pass(workspace)
    added = URL.replace("/color/", "/again/")
    assert client.get(f"{added}?v=1").headers["cache-control"] == "no-cache"
    assert client.get(f"{URL}?v=2").headers["cache-control"] == "no-cache"
    with SqliteTileStore(workspace.store_path("tea", "0-45+1")) as store:
        store.remove_block(BlockId(1, 0, 0))
    assert (client.get(added).status_code, client.get(URL).status_code) == (204, 200)


@pytest.mark.parametrize("view", ["0-45+1", "0-45%2B1", "0-45+0", "0-45+"])
def test_a_track_is_not_a_view(client, workspace, view):
    add_pass(workspace)
    assert client.get(f"/tiles/tea/{view}/again/{ZMAX}/7/7").status_code == 404


def test_an_unknown_layer_error_lists_the_layers(client, workspace):
    add_pass(workspace)
    response = client.get("/tiles/tea/0-45/other/0/0/0")
    assert (response.status_code, response.text) == (404, "no layer 'other'; the layers are color, normal, id, depth, again, coarse\n")


def test_a_replaced_rendering_is_reopened(client, workspace, monkeypatch):
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


def test_errors_contain_no_paths_and_are_not_cached(client, workspace, monkeypatch):
    def fail(*_):
        raise StoreError(f"{workspace.root}: disk I/O error")

    with monkeypatch.context() as broken:
        broken.setattr(SqliteTileStore, "get_tile", fail)
        response = client.get(f"{URL}?v=1")
    assert (response.status_code, response.headers["cache-control"]) == (503, "no-store")
    assert str(workspace.root) not in response.text
    assert client.get(f"{URL}?v=1").status_code == 200


def test_cached_tiles_need_no_store(client, monkeypatch):
    client.get(f"{URL}?v=1")
    monkeypatch.setattr(SqliteTileStore, "get_tile", None)
    assert client.get(f"{URL}?v=1").content == tile_bytes("0-45", "color", TILE)
    assert len(client.app.tiles.cache) == 1


def test_different_queries_do_not_fill_the_cache(client):
    for junk in range(20):
        client.get(f"{URL}?v=1&junk={junk}")
        client.get(f"{URL}?v={junk + 2}")
    assert len(client.app.tiles.cache) == 0
