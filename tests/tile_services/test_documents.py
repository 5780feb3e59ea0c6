"""The documents as pure functions of manifests, against the published schemas."""

import json
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree

import pytest
from PIL import Image
from pyproj import CRS

from map3d.errors import BadRequest
from map3d.geometry.frames import pin
from map3d.tile_services import ogc_documents, ogc_openapi, wmts
from map3d.tile_services.tile_formats import convert_tile, empty_tile
from map3d.tile_services.tiled_view import PSEUDO, NotOffered, find_tiled_view, tiled_views
from map3d.tile_services.tilejson import tilejson
from map3d.tiles.manifest import ManifestCrs
from map3d.tiles.occupancy import Occupancy
from map3d.types import Layer
from tests.tile_services.standards import check_ogcapi, check_tms
from tests.web.workspaces import OCCUPIED, VIEWS, ZMAX, manifest_of, rendering_record

ROOT = "https://example.org/ogc"
OWS = "{http://www.opengis.net/ows/1.1}"
WMTS = "{http://www.opengis.net/wmts/1.0}"


@pytest.fixture(scope="module")
def manifest():
    return manifest_of(rendering_record(), Occupancy.from_tiles(ZMAX, OCCUPIED), 1)


@pytest.fixture(scope="module")
def views(manifest):
    return tiled_views(manifest)


def test_each_view_is_offered_with_its_plane_and_in_pseudo_web_mercator(views):
    assert [view.id for view in views] == ["tea:0-45", "tea:0-45:pseudo-mercator", "tea:45-22.5", "tea:45-22.5:pseudo-mercator"]
    assert [layer.name for layer in views[0].layers] == ["color"]
    assert all((PSEUDO in view.title) == view.pseudo for view in views)


def test_tiles_of_512_px_are_not_offered_in_web_mercator(manifest):
    frames = pin(manifest.box, 512, 0.1, VIEWS)
    large = replace(manifest, views=tuple(replace(view, frame=replace(frame, zmax=ZMAX)) for view, frame in zip(manifest.views, frames, strict=True)))
    assert [view.id for view in tiled_views(large)] == ["tea:0-45", "tea:45-22.5"]


def test_a_rendering_without_colours_is_not_offered(manifest):
    assert tiled_views(replace(manifest, passes=((Layer("id", "id", "png"),),))) == ()


def test_levels_place_tiles_as_the_pyramid_does(views):
    view, frame = views[2], views[2].view.frame
    for matrix in view.matrices:
        assert matrix.cell_size == frame.pixel_m(matrix.level)
        assert matrix.scale_denominator * 0.00028 == pytest.approx(matrix.cell_size)
        assert matrix.origin == (frame.u0_m, frame.v0_m)
        occupied = view.view.occupancy.tiles(matrix.level)
        assert all(matrix.holds(tile.x, tile.y) for tile in occupied)
        assert {matrix.min_column, matrix.max_column} <= {tile.x for tile in occupied}
        assert {matrix.min_row, matrix.max_row} <= {tile.y for tile in occupied}


def test_the_landing_page_and_the_conformance_follow_the_schemas():
    check_ogcapi(ogc_documents.landing_page(ROOT), "landingPage")
    check_ogcapi(ogc_documents.conformance(), "confClasses")


def test_collections_follow_the_schema(views):
    """Its schema of extents with more dimensions takes `spatial` for a dimension, so the extent is checked by the plain one."""
    document = ogc_documents.collections(views, ROOT)
    check_ogcapi({**document, "collections": [{**row, "extent": {}} for row in document["collections"]]}, "collections")
    for row in document["collections"]:
        check_ogcapi(row["extent"], "extent")
    assert [row["id"] for row in document["collections"]] == [view.id for view in views]
    west, south, east, north = document["collections"][0]["extent"]["spatial"]["bbox"][0]
    assert 11.5 < west < east < 11.6
    assert 48.1 < south < north < 48.2


def test_a_scene_with_local_coordinates_has_no_extent(manifest):
    local = tiled_views(replace(manifest, crs=ManifestCrs("local")))[0]
    assert "extent" not in ogc_documents.collection(local, ROOT)
    check_tms(ogc_documents.tile_matrix_set(local, ROOT), "tileMatrixSet.json")
    assert local.crs().is_engineering


def test_tile_sets_follow_the_schema(views):
    for view in views:
        for layer in (None, view.layers[0]):
            check_tms(ogc_documents.tile_set(view, ROOT, layer), "tileSet.json")
            listed = ogc_documents.tile_sets(view, ROOT, layer)
            for row in listed["tilesets"]:
                check_ogcapi(row, "tileSet-item")
                assert row["tileMatrixSetLimits"][-1]["maxTileRow"] == 2**ZMAX - 1
                items = [link for link in row["links"] if link["rel"] == "item"]
                assert [item["type"] for item in items] == ["image/webp", "image/png"]
                assert all(item["templated"] and "{tileRow}/{tileCol}" in item["href"] for item in items)


def test_tile_matrix_sets_follow_the_schema_and_carry_the_plane(views):
    for view in views:
        document = ogc_documents.tile_matrix_set(view, ROOT)
        check_tms(document, "tileMatrixSet.json")
        assert [row["id"] for row in document["tileMatrices"]] == [row["identifier"] for row in document["tileMatrix"]]
        if not view.pseudo:
            assert CRS.from_json_dict(document["crs"]["wkt"]) == view.crs()
            assert CRS.from_wkt(document["supportedCRS"]).name == view.crs().name
    listed = ogc_documents.tile_matrix_sets(views, ROOT)["tileMatrixSets"]
    assert [row["id"] for row in listed] == ["tea:0-45", "WebMercatorQuad", "tea:45-22.5"]
    for row in listed:
        check_ogcapi(row, "tileMatrixSet-item")


def test_web_mercator_has_the_registered_scales(views):
    """OGC 17-083r4, table D.1."""
    matrices = ogc_documents.tile_matrix_set(views[1], ROOT)["tileMatrices"]
    assert matrices[0]["scaleDenominator"] == pytest.approx(559082264.028717, rel=1e-12)
    assert matrices[3]["scaleDenominator"] == pytest.approx(69885283.0035897, rel=1e-12)
    assert matrices[0]["pointOfOrigin"] == pytest.approx([-20037508.3427892, 20037508.3427892])


def test_the_api_definition_has_the_operation_ids_of_the_standard():
    paths = ogc_openapi.definition(ROOT)["paths"]
    ids = [path["get"]["operationId"] for path in paths.values()]
    assert len(ids) == len(set(ids))
    assert {".collection.map.getTile", ".collection.map.getTileSet", ".collection.map.getTileSetsList"} <= set(ids)
    for path, operation in paths.items():
        named = {row["$ref"].rpartition("/")[2] for row in operation["get"]["parameters"] if "$ref" in row}
        assert named == {part[1:-1] for part in path.split("/") if part.startswith("{")}


def test_tilejson_has_the_fields_of_version_3(views):
    document = tilejson(views[0], "https://example.org", views[0].layers[0])
    assert document["tilejson"] == "3.0.0"
    assert document["tiles"] == ["https://example.org/xyz/tea/0-45/color/{z}/{x}/{y}.webp"]
    west, south, east, north = document["bounds"]
    assert -180 <= west < east <= 180
    assert -85.06 < south < north < 85.06
    assert (document["maxzoom"], document["vector_layers"]) == (ZMAX, [])
    assert PSEUDO in document["name"]
    json.dumps(document, allow_nan=False)


def test_capabilities_name_layers_styles_grids_and_limits(views):
    document = ElementTree.fromstring(wmts.capabilities(views, "https://example.org/wmts"))
    layers = document.findall(f"{WMTS}Contents/{WMTS}Layer")
    assert [layer.findtext(f"{OWS}Identifier") for layer in layers] == [view.id for view in views]
    sets = document.findall(f"{WMTS}Contents/{WMTS}TileMatrixSet")
    assert [one.findtext(f"{OWS}Identifier") for one in sets] == ["tea:0-45", "WebMercatorQuad", "tea:45-22.5"]
    assert CRS.from_wkt(sets[0].findtext(f"{OWS}SupportedCRS")).name == views[0].crs().name
    limits = layers[0].findall(f"{WMTS}TileMatrixSetLink/{WMTS}TileMatrixSetLimits/{WMTS}TileMatrixLimits")
    assert len(limits) == ZMAX + 1
    deepest = {child.tag.removeprefix(WMTS): child.text for child in limits[-1]}
    assert deepest == {"TileMatrix": "4", "MinTileRow": "0", "MaxTileRow": "15", "MinTileCol": "0", "MaxTileCol": "15"}
    templates = [one.get("template") for one in layers[0].findall(f"{WMTS}ResourceURL")]
    assert templates[1] == "https://example.org/wmts/1.0.0/tea:0-45/{Style}/{TileMatrixSet}/{TileMatrix}/{TileRow}/{TileCol}.png"


def test_texts_are_escaped(manifest):
    named = tiled_views(replace(manifest, title='<b>"&', attribution="<script>"))
    document = ElementTree.fromstring(wmts.capabilities(named, ROOT))
    assert document.find(f"{WMTS}Contents/{WMTS}Layer").findtext(f"{OWS}Title").startswith('<b>"&')
    assert "<" not in tilejson(named[0], ROOT, named[0].layers[0])["attribution"]


def test_unknown_views_and_layers_are_named(views):
    with pytest.raises(NotOffered, match="tea:9-9"):
        find_tiled_view(views, "tea:9-9")
    with pytest.raises(NotOffered, match="colour layers are color"):
        views[0].layer("normal")
    with pytest.raises(NotOffered, match="tile matrix set"):
        views[0].check_tile_matrix_set("WebMercatorQuad")
    with pytest.raises(BadRequest):
        views[0].crs(float("nan"))


@pytest.mark.parametrize("media_type", ["image/webp", "image/png", "image/jpeg"])
def test_an_empty_tile_is_an_image_of_the_size(media_type):
    with Image.open(BytesIO(empty_tile(256, media_type))) as tile:
        assert (tile.size, Image.MIME[tile.format]) == ((256, 256), media_type)
        values = tile.convert("RGBA").getextrema()
    assert values == (((255, 255),) * 4 if media_type == "image/jpeg" else values)
    assert values[3] == ((255, 255) if media_type == "image/jpeg" else (0, 0))


def test_conversion_keeps_the_pixels():
    data = BytesIO()
    with Image.effect_mandelbrot((64, 64), (-2, -1, 1, 1), 20).convert("RGBA") as tile:
        tile.putalpha(tile.getchannel("R"))
        tile.save(data, "WEBP", lossless=True, exact=True)
        with Image.open(BytesIO(convert_tile(data.getvalue(), "image/png"))) as converted:
            assert converted.tobytes() == tile.tobytes()
