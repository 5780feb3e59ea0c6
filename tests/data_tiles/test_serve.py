"""The server and the portrayal service on data tiles: everything that a client gets equals what it gets of the rendering with PNG layers."""

import io
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.catalogue import Workspace
from map3d.errors import Corrupt
from map3d.portrayal.pyramid_views import AlignedView, PyramidViews
from map3d.publish.exports import export
from map3d.publish.preview_picture import HEIGHT_PX, WIDTH_PX, make_preview
from map3d.tiles.preview import choose_preview
from tests.data_tiles.towns import KINDS, VIEW, damage, manifest_of, record_of, stored_tiles
from tests.web.conftest import Client

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
pytestmark = pytest.mark.whole

RESOURCE = "/3dps?service=3DPS&version=1.0&request=GetResourceById&resourceId=tiles"


def url(rendering: str, layer: str, tile: tuple[int, int, int], query: str = "") -> str:
    return f"/tiles/{rendering}/{VIEW}/{layer}/{'/'.join(map(str, tile))}{query}"


def test_the_data_layer_is_served_as_stored(client: Client, workspace: Workspace) -> None:
    for tile, data in list(stored_tiles(workspace, "tile", "data").items())[:8]:
        response = client.get(url("tile", "data", tile))
        assert (response.status_code, response.content) == (200, data)
        assert response.headers["content-type"] == "application/vnd.map3d.data"


@pytest.mark.parametrize("layer", KINDS)
def test_png_layers_made_of_data_tiles_have_the_bytes_of_the_png_rendering(client: Client, workspace: Workspace, layer: str) -> None:
    for tile, data in stored_tiles(workspace, "png", layer).items():
        expected, found = (client.get(url(rendering, layer, tile, "?v=1")) for rendering in ("png", "tile"))
        assert expected.content == data
        assert (found.status_code, found.content) == (200, data)
        assert dict(found.headers) == dict(expected.headers)
    tag = found.headers["etag"]
    assert client.get(url("tile", layer, tile), headers={"if-none-match": tag}).status_code == 304
    part = client.get(url("tile", layer, tile), headers={"range": "bytes=8-19"})
    assert (part.status_code, part.content) == (206, data[8:20])
    assert client.get(url("tile", layer, (0, 0, 0)), headers={}).status_code == 200
    assert client.get(url("tile", layer, (9, 0, 0))).status_code == 404


def test_layers_that_neither_exist_nor_can_be_made_are_not_found(client: Client) -> None:
    response = client.get(url("tile", "depth2", (0, 0, 0)))
    assert (response.status_code, response.text) == (404, "no layer 'depth2'; the layers are color, data, ao, normal, id, depth\n")
    assert client.get(url("png", "data", (0, 0, 0))).status_code == 404


def test_a_damaged_data_tile_is_refused_as_png(workspace: Workspace, client: Client, caplog: pytest.LogCaptureFixture) -> None:
    tile = damage(workspace, "tile", "data", b"M3D\1" + bytes(20))
    for layer in KINDS:
        response = client.get(url("tile", layer, tile))
        assert (response.status_code, response.text) == (500, "the server's data is damaged; see the server log\n")
        assert response.headers["cache-control"] == "no-store"
        assert client.get(url("tile", layer, (0, 0, 0))).status_code == 200, "other tiles stay"
        answer = client.get(f"{RESOURCE}/tile/{VIEW}/{layer}/{tile.z}/{tile.x}/{tile.y}&outputFormat=image/png")
        assert (answer.status_code, str(workspace.root) in answer.text) == (500, False)
        assert f"tile data/{tile.z}/{tile.x}/{tile.y}: data tile: " in caplog.text
        assert f"tile {VIEW}/data/{tile.z}/{tile.x}/{tile.y}: data tile: " in caplog.text
        caplog.clear()


@pytest.mark.parametrize("path", ["/tilejson/{}/35-40.json", "/ogc/collections/{}:35-40/styles", "/wmts?service=WMTS&request=GetCapabilities"])
def test_tile_services_offer_the_same_layers(client: Client, path: str) -> None:
    answers = [client.get(path.format(rendering)) for rendering in ("png", "tile")]
    assert [answer.status_code for answer in answers] == [200, 200]
    expected, found = (answer.text for answer in answers)
    if "{}" in path:
        assert re.sub(r'(?<=[/":])tile(?=[/":])', "png", found) == expected
    assert "m3d" not in found
    assert "map3d.data" not in found


def test_pictures_are_lit_by_the_normals_of_data_tiles(client: Client) -> None:
    manifest = json.loads(client.get("/tiles/tile/rendering.json").content)
    x, y, _ = manifest["start"]["local"]
    east, north, _ = manifest["origin"]
    where = f"{east + x:.2f},{north + y:.2f},2,35,40"
    answers = {}
    for rendering in ("png", "tile"):
        for style in ("lit", "color"):
            response = client.get(f"/pictures/{rendering}/{where}/400x300.png?style={style}")
            assert response.status_code == 200, response.text
            answers[rendering, style] = response.content
    assert answers["tile", "lit"] == answers["png", "lit"] != answers["png", "color"]


def test_previews_are_equal(workspace: Workspace) -> None:
    previews = [make_preview(workspace, record_of(workspace, name), manifest_of(workspace, name)) for name in ("png", "tile")]
    assert previews[0] is not None
    assert previews[0] == previews[1]


def test_previews_of_damaged_tiles_fail_with_the_tile_in_the_message(workspace: Workspace) -> None:
    manifest = manifest_of(workspace, "tile")
    chosen = choose_preview(manifest, aspect=WIDTH_PX / HEIGHT_PX, min_width_px=WIDTH_PX)
    assert chosen is not None
    tile = damage(workspace, "tile", "data", b"M3D\1" + bytes(20), chosen.tiles[0])
    with pytest.raises(Corrupt, match=f"tile {VIEW}/data/{tile.z}/{tile.x}/{tile.y}: data tile: .*map3d verify"):
        make_preview(workspace, record_of(workspace, "tile"), manifest)


def test_views_of_the_pyramid_have_the_pixels_of_the_png_rendering(workspace: Workspace) -> None:
    catalogue = workspace.open_catalogue()
    try:
        views, found = PyramidViews(workspace, catalogue), []
        for name in ("png", "tile"):
            record = catalogue.rendering(name)
            side = record.tile_px << record.zmax
            place = AlignedView(record, record.frames[0], record.zmax, side // 3, side // 3, 700, 500, 0.0)
            kinds = ("color", *KINDS)
            arrays = views.read(place, kinds)
            assert arrays is not None
            assert set(arrays) == set(kinds)
            assert views.read(place, ("id",)) is not None
            found.append(arrays)
            assert views.read(replace(place, left=-100), ("depth",)) is not None
    finally:
        catalogue.close()
    assert found[0]["id"].any()
    for kind, array in found[0].items():
        assert np.array_equal(found[1][kind], array, equal_nan=kind == "depth")


def test_a_damaged_tile_makes_a_view_unreadable(workspace: Workspace) -> None:
    tile = damage(workspace, "tile", "data", b"M3D\1" + bytes(20))
    catalogue = workspace.open_catalogue()
    try:
        record = catalogue.rendering("tile")
        views = PyramidViews(workspace, catalogue)
        px = record.tile_px
        place = AlignedView(record, record.frames[0], record.zmax, tile.x * px, tile.y * px, px, px, 0.0)
        assert views.read(place, ("normal",)) is None
        assert views.read(place, ("color",)) is not None
    finally:
        catalogue.close()


@pytest.mark.parametrize("layer", KINDS)
def test_the_portrayal_service_answers_png_layers_and_data_tiles(client: Client, workspace: Workspace, layer: str) -> None:
    tile, data = next(iter(stored_tiles(workspace, "png", layer).items()))
    place = "/".join(map(str, tile))
    response = client.get(f"{RESOURCE}/tile/{VIEW}/{layer}/{place}&outputFormat=image/png")
    assert (response.status_code, response.content) == (200, data)
    stored = stored_tiles(workspace, "tile", "data")[tile]
    response = client.get(f"{RESOURCE}/tile/{VIEW}/data/{place}&outputFormat=application/vnd.map3d.data")
    assert (response.status_code, response.content) == (200, stored)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("layer", KINDS)
@pytest.mark.parametrize("to", ["xyz", "dzi"])
def test_exports_of_png_layers_are_equal(workspace: Workspace, tmp_path: Path, to: str, layer: str) -> None:
    for rendering in ("png", "tile"):
        out = tmp_path / rendering / ("a.dzi" if to == "dzi" else "a")
        out.parent.mkdir()
        export(workspace, rendering, out, to=to, view=VIEW, layer=layer)  # type: ignore[arg-type]
    expected = contents(tmp_path / "png")
    assert expected
    assert contents(tmp_path / "tile") == expected


def test_data_tiles_are_exported_as_stored(workspace: Workspace, tmp_path: Path) -> None:
    export(workspace, "tile", tmp_path / "a", to="xyz", view=VIEW, layer="data")
    expected = {f"{tile.z}/{tile.x}/{tile.y}.m3d": data for tile, data in stored_tiles(workspace, "tile", "data").items()}
    assert contents(tmp_path / "a") == expected


def test_an_export_names_a_damaged_tile(workspace: Workspace, tmp_path: Path) -> None:
    tile = damage(workspace, "tile", "data", b"M3D\1" + bytes(20))
    with pytest.raises(Corrupt, match=f"tile data/{tile.z}/{tile.x}/{tile.y}: data tile: .*map3d verify"):
        export(workspace, "tile", tmp_path / "a.mbtiles", to="mbtiles", view=VIEW, layer="id")


def test_exported_pngs_are_images_of_the_layer(workspace: Workspace, tmp_path: Path) -> None:
    export(workspace, "tile", tmp_path / "a", to="xyz", view=VIEW, layer="depth")
    with Image.open(io.BytesIO((tmp_path / "a" / "0" / "0" / "0.png").read_bytes())) as image:
        assert (image.size, image.mode) == ((256, 256), "RGBA")
