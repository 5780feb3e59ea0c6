"""Tiles and documents of the tile services, over HTTP."""

from io import BytesIO
from xml.etree import ElementTree

import pytest
from PIL import Image

from map3d.tiles.naming import block_levels
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import BlockId, TileId
from tests.web.workspaces import OCCUPIED, ZMAX, add_pass, manifest_of, put_block, rendering_record, tile_bytes

OWS = "{http://www.opengis.net/ows/1.1}"
WMTS = "{http://www.opengis.net/wmts/1.0}"
FULL, EMPTY, OUTSIDE = (4, 2, 3), (4, 3, 3), (4, 16, 3)
"""z, x, y of a tile with content, one without, and one that does not exist."""


def urls(tile, suffix="webp"):
    z, x, y = tile
    return {
        "xyz": f"/xyz/tea/0-45/{z}/{x}/{y}.{suffix}",
        "xyz with layer": f"/xyz/tea/0-45/color/{z}/{x}/{y}.{suffix}",
        "ogc": f"/ogc/collections/tea:0-45/map/tiles/tea:0-45/{z}/{y}/{x}?f={suffix}",
        "ogc pseudo": f"/ogc/collections/tea:0-45:pseudo-mercator/map/tiles/WebMercatorQuad/{z}/{y}/{x}?f={suffix}",
        "ogc with style": f"/ogc/collections/tea:0-45/styles/color/map/tiles/tea:0-45/{z}/{y}/{x}?f={suffix}",
        "wmts": f"/wmts/1.0.0/tea:0-45/color/tea:0-45/{z}/{y}/{x}.{suffix}",
        "wmts pairs": "/wmts?Service=WMTS&REQUEST=GetTile&VERSION=1.0.0&LAYER=tea:0-45&STYLE=&TILEMATRIXSET=tea:0-45"
        f"&FORMAT=image/{suffix}&TileMatrix={z}&TILEROW={y}&tilecol={x}",
    }


@pytest.mark.parametrize("service", urls(FULL))
def test_every_service_sends_the_stored_bytes(client, service):
    stored = client.get("/tiles/tea/0-45/color/4/2/3")
    response = client.get(urls(FULL)[service])
    assert (response.status_code, response.content, response.headers["content-type"]) == (200, stored.content, "image/webp")
    assert response.headers["etag"] == stored.headers["etag"]
    assert response.headers["cache-control"] == "no-cache"
    assert response.headers["access-control-allow-origin"] == "*"
    assert client.get(urls(FULL)[service], headers={"if-none-match": stored.headers["etag"]}).status_code == 304


@pytest.mark.parametrize("service", urls(FULL))
def test_png_is_converted_with_a_validator_of_its_own(client, service):
    url = urls(FULL, "png")[service]
    response = client.get(url)
    with Image.open(BytesIO(response.content)) as tile, Image.open(BytesIO(tile_bytes("0-45", "color", TileId(*FULL)))) as stored:
        assert tile.format == "PNG"
        assert tile.convert("RGBA").tobytes() == stored.convert("RGBA").tobytes()
    etag = response.headers["etag"]
    assert etag != client.get(urls(FULL)["xyz"]).headers["etag"]
    again = client.get(url, headers={"if-none-match": etag})
    assert (again.status_code, again.content) == (304, b"")
    head = client.request("HEAD", url)
    assert (head.headers["content-length"], head.content) == (str(len(response.content)), b"")


@pytest.mark.parametrize("suffix", ["webp", "png"])
@pytest.mark.parametrize("service", urls(EMPTY))
def test_an_empty_tile_within_the_limits_is_a_transparent_image(client, service, suffix):
    response = client.get(urls(EMPTY, suffix)[service])
    assert response.status_code == 200
    with Image.open(BytesIO(response.content)) as tile:
        assert (tile.format.lower(), tile.size) == (suffix, (256, 256))
        assert tile.convert("RGBA").getextrema()[3] == (0, 0)
    head = client.request("HEAD", urls(EMPTY, suffix)[service])
    assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", str(len(response.content)))


def test_a_tile_that_is_not_rendered_yet_is_an_image_that_is_not_stored(client, workspace):
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        store.remove_block(BlockId(1, 0, 0))
    response = client.get(urls(FULL)["xyz"])
    assert (response.status_code, response.headers["cache-control"]) == (200, "no-store")


@pytest.mark.parametrize(("service", "status"), [("xyz", 404), ("ogc", 404), ("wmts", 400), ("wmts pairs", 400)])
def test_a_tile_that_does_not_exist_is_refused(client, service, status):
    for tile in (OUTSIDE, (5, 0, 0), (27, 0, 0)):
        response = client.get(urls(tile)[service])
        assert (response.status_code, response.headers["cache-control"]) == (status, "no-store"), tile
        assert response.headers["access-control-allow-origin"] == "*"


def test_changed_tiles_are_sent_once_the_manifest_names_them(client, workspace):
    url = urls(FULL)["wmts"]
    assert client.get(url).content == tile_bytes("0-45", "color", TileId(*FULL))
    occupancy = Occupancy.from_tiles(ZMAX, OCCUPIED)
    with SqliteTileStore(workspace.store_path("tea", "0-45")) as store:
        for level in block_levels(ZMAX):
            for tile in occupancy.tiles(level.root):
                put_block(store, "0-45", BlockId(*tile), occupancy, version=2, salt="new ")
    workspace.manifest_path("tea").write_bytes(manifest_of(rendering_record(), occupancy, 2).dump())
    client.app.tile_services._views._known.clear()
    assert client.get(url).content == tile_bytes("0-45", "color", TileId(*FULL), "new ")


def exception_of(response):
    assert response.headers["content-type"].startswith("text/xml")
    found = ElementTree.fromstring(response.content).find(f"{OWS}Exception")
    return found.get("exceptionCode"), found.get("locator")


PAIRS = {
    "service": "WMTS",
    "request": "GetTile",
    "version": "1.0.0",
    "layer": "tea:0-45",
    "style": "color",
    "tilematrixset": "tea:0-45",
    "format": "image/png",
    "tilematrix": "4",
    "tilerow": "3",
    "tilecol": "2",
}


@pytest.mark.parametrize(
    ("change", "code", "locator"),
    [
        ({"layer": None}, "MissingParameterValue", "LAYER"),
        ({"tilecol": None}, "MissingParameterValue", "TILECOL"),
        ({"version": "2.0.0"}, "InvalidParameterValue", "VERSION"),
        ({"layer": "tea:9-9"}, "InvalidParameterValue", "Layer"),
        ({"layer": "nothing"}, "InvalidParameterValue", "Layer"),
        ({"style": "normal"}, "InvalidParameterValue", "Layer"),
        ({"format": "image/gif"}, "InvalidParameterValue", "Format"),
        ({"tilematrixset": "WebMercatorQuad"}, "InvalidParameterValue", "Layer"),
        ({"tilerow": "16"}, "TileOutOfRange", "TileRow"),
        ({"tilerow": "-1"}, "TileOutOfRange", "TileRow"),
        ({"tilerow": "٣"}, "TileOutOfRange", "TileRow"),
    ],
)
def test_wmts_reports_what_is_wrong(client, change, code, locator):
    pairs = {key: value for key, value in {**PAIRS, **change}.items() if value is not None}
    assert client.get("/wmts", params=PAIRS).status_code == 200
    response = client.get("/wmts", params=pairs)
    assert response.status_code == 400
    assert exception_of(response) == (code, locator)


def test_wmts_knows_two_operations(client):
    assert exception_of(client.get("/wmts")) == ("MissingParameterValue", "REQUEST")
    assert exception_of(client.get("/wmts?request=GetMap")) == ("OperationNotSupported", "REQUEST")
    by_pairs, by_path = client.get("/wmts?SERVICE=WMTS&REQUEST=GetCapabilities"), client.get("/wmts/1.0.0/WMTSCapabilities.xml")
    assert by_pairs.content == by_path.content
    assert ElementTree.fromstring(by_path.content).tag == f"{WMTS}Capabilities"


@pytest.mark.parametrize(
    "path",
    [
        "/xyz/tea/0-45/4/2/3",
        "/xyz/tea/0-45/4/2/3.gif",
        "/xyz/tea/0-45/normal/4/2/3.png",
        "/xyz/tea/0-45/04/2/3.webp",
        "/xyz/tea/0-45/4/2/٣.webp",
        "/xyz/tea/9-9/4/2/3.webp",
        "/xyz/../4/2/3.webp",
        "/xyz/nothing/0-45/4/2/3.webp",
        "/ogc/collections/tea:0-45/map/tiles/WebMercatorQuad/4/3/2",
        "/ogc/collections/tea/map/tiles/tea/4/3/2",
        "/ogc/collections/nothing",
        "/ogc/collections/nothing:0-45",
        "/ogc/tileMatrixSets/nothing",
        "/tilejson/tea/9-9.json",
        "/tilejson/nothing/0-45.json",
        "/tilejson/tea/0-45.json?layer=normal",
    ],
)
def test_what_is_not_offered_is_404_without_paths_of_the_server(client, path, workspace):
    response = client.get(path)
    assert response.status_code == 404
    assert str(workspace.root) not in response.text
    assert response.headers["cache-control"] == "no-store"


def test_hostile_queries_are_400(client):
    base = urls(FULL)["ogc"].partition("?")[0]
    for query in ("f=gif", "f=" + "x" * 5000, "&".join(f"a{n}=1" for n in range(65)), "f=%00"):
        response = client.get(f"{base}?{query}")
        assert response.status_code == 400, query[:20]
        assert response.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_tiles_are_only_read(client, method):
    response = client.request(method, urls(FULL)["xyz"])
    assert (response.status_code, response.headers["allow"]) == (405, "GET, HEAD")


@pytest.mark.parametrize(
    "path",
    [
        "/ogc",
        "/ogc/conformance",
        "/ogc/api",
        "/ogc/collections",
        "/ogc/collections/tea:0-45",
        "/ogc/collections/tea:0-45/map/tiles",
        "/ogc/collections/tea:0-45/styles/color/map/tiles/tea:0-45",
        "/ogc/tileMatrixSets",
        "/ogc/tileMatrixSets/tea:0-45",
        "/ogc/tileMatrixSets/WebMercatorQuad",
        "/tilejson/tea/0-45.json",
    ],
)
def test_documents_are_revalidated_and_open_to_all_origins(client, path):
    response = client.get(path)
    assert response.status_code == 200
    assert response.headers["access-control-allow-origin"] == "*"
    assert response.headers["cache-control"] == "no-cache"
    assert client.get(path, headers={"if-none-match": response.headers["etag"]}).status_code == 304


def test_all_links_of_the_api_lead_to_documents(client):
    seen, todo = set(), ["/ogc"]
    while todo:
        path = todo.pop()
        seen.add(path)
        response = client.get(path)
        assert response.status_code == 200, path
        found = [link for link in _links(response.json()) if not link.get("templated") and link["href"].startswith("http://test/")]
        todo += sorted({link["href"].removeprefix("http://test") for link in found} - seen - set(todo))
    assert {"/ogc/collections/tea:45-22.5:pseudo-mercator/map/tiles/WebMercatorQuad", "/ogc/api", "/ogc/tileMatrixSets/WebMercatorQuad"} <= seen


def _links(value):
    if isinstance(value, dict):
        yield from value.get("links", ()) if isinstance(value.get("links"), list) else ()
        for child in value.values():
            yield from _links(child)
    elif isinstance(value, list):
        for child in value:
            yield from _links(child)


def test_layers_that_are_added_later_are_offered(client, workspace):
    assert client.get("/tilejson/tea/0-45.json?layer=coarse").status_code == 404
    add_pass(workspace)
    client.app.tile_services._views._known.clear()
    assert client.get("/tilejson/tea/0-45.json?layer=coarse").json()["tiles"] == ["http://test/xyz/tea/0-45/coarse/{z}/{x}/{y}.jpg"]
    response = client.get("/xyz/tea/0-45/coarse/4/2/3.jpg")
    assert (response.status_code, response.headers["content-type"]) == (200, "image/jpeg")
    empty = client.get("/xyz/tea/0-45/coarse/4/3/3.jpg")
    with Image.open(BytesIO(empty.content)) as tile:
        assert tile.getextrema() == ((255, 255),) * 3


def test_an_unreadable_manifest_leaves_the_other_renderings(client, workspace):
    assert len(client.get("/ogc/collections").json()["collections"]) == 4
    workspace.manifest_path("tea").write_text("{}")
    assert client.get("/ogc/collections").json()["collections"] == []
