"""Routes of the documents of the tile services: OGC API – Tiles, WMTS and TileJSON. Their tiles: tile_service_route.py."""

import json
import math
from typing import Any, Final

from starlette.responses import Response

from map3d.errors import BadRequest
from map3d.geometry.view_plane_crs import check_height
from map3d.publish.layer_definitions import SUFFIXES, gdal_wms, qgis_layer, wkt
from map3d.tile_services import ogc_documents, ogc_openapi, wmts
from map3d.tile_services.tile_formats import suffix_of
from map3d.tile_services.tiled_view import WEB_MERCATOR, NotOffered, TiledView
from map3d.tile_services.tilejson import tilejson, xyz_template
from map3d.types import Layer
from map3d.web.http.current import request, site
from map3d.web.http.public_url import public_url
from map3d.web.http.responses import document, uncached
from map3d.web.http.routes import Routes

tile_services = Routes("tile_services")

MAX_NUMBER: Final = 32
"""Characters of a number."""
_JSON: Final = "application/json"


@tile_services.get("/ogc")
@tile_services.get("/ogc/")
def landing_page() -> Response:
    return _json(ogc_documents.landing_page(_ogc()))


@tile_services.get("/ogc/conformance")
def conformance() -> Response:
    return _json(ogc_documents.conformance())


@tile_services.get("/ogc/api")
def api() -> Response:
    return _json(ogc_openapi.definition(_ogc()), "application/vnd.oai.openapi+json;version=3.0")


@tile_services.get("/ogc/collections")
def collections() -> Response:
    return _json(ogc_documents.collections(site().views.all(), _ogc()))


@tile_services.get("/ogc/collections/{collection}")
def collection(collection: str) -> Response:
    return _json(ogc_documents.collection(_view(collection), _ogc()))


@tile_services.get("/ogc/collections/{collection}/styles")
def styles(collection: str) -> Response:
    return _json(ogc_documents.styles(_view(collection), _ogc()))


@tile_services.get("/ogc/collections/{collection}/map/tiles")
@tile_services.get("/ogc/collections/{collection}/styles/{style}/map/tiles")
def tile_sets(collection: str, style: str | None = None) -> Response:
    view = _view(collection)
    return _json(ogc_documents.tile_sets(view, _ogc(), _layer(view, style)))


@tile_services.get("/ogc/collections/{collection}/map/tiles/{tile_matrix_set}")
@tile_services.get("/ogc/collections/{collection}/styles/{style}/map/tiles/{tile_matrix_set}")
def tile_set(collection: str, tile_matrix_set: str, style: str | None = None) -> Response:
    view = _view(collection)
    view.check_tile_matrix_set(tile_matrix_set)
    return _json(ogc_documents.tile_set(view, _ogc(), _layer(view, style)))


@tile_services.get("/ogc/tileMatrixSets")
def tile_matrix_sets() -> Response:
    return _json(ogc_documents.tile_matrix_sets(site().views.all(), _ogc()))


@tile_services.get("/ogc/tileMatrixSets/{name}")
def tile_matrix_set(name: str) -> Response:
    view = _web_mercator_view() if name == WEB_MERCATOR else _view(name)
    view.check_tile_matrix_set(name)
    return _json(ogc_documents.tile_matrix_set(view, _ogc()))


@tile_services.get(f"/wmts/{wmts.VERSION}/WMTSCapabilities.xml")
def wmts_capabilities() -> Response:
    return document(wmts.capabilities(site().views.all(), public_url("wmts")), "application/xml")


@tile_services.get("/wmts")
def wmts_key_value_pairs() -> Response:
    """Answers GetCapabilities; the tile service route answers GetTile."""
    pairs = {key.lower(): value for key, value in request().query_params.items()}
    operation = pairs.get("request", "")
    if operation.lower() == "getcapabilities":
        return wmts_capabilities()
    code, text = (
        ("MissingParameterValue", "parameter REQUEST is missing") if not operation else ("OperationNotSupported", f"no operation {operation!r:.70}")
    )
    report = wmts.exception_report(code, f"{text}; expected GetCapabilities or GetTile", "REQUEST")
    return uncached(report, 400, "text/xml")


@tile_services.get("/tilejson/{rendering}/{view}.json")
def tile_json(rendering: str, view: str) -> Response:
    found = site().views.view(rendering, f"{rendering}:{view}")
    return _json(tilejson(found, public_url(), found.layer(request().query_params.get("layer"))))


@tile_services.get("/gis/{rendering}/{view}.{suffix}")
def layer_definition(rendering: str, view: str, suffix: str) -> Response:
    """Returns a layer definition for QGIS (qlr) or GDAL (xml), or the CRS of the view's plane (wkt), for ground points at the query's `height`."""
    found = site().views.view(rendering, f"{rendering}:{view}")
    if suffix not in SUFFIXES:
        raise NotOffered(f"no definition {suffix!r:.70}; expected {', '.join(SUFFIXES)}")
    manifest, height_m = found.manifest, _height()
    if suffix == "wkt":
        return document(wkt(manifest, found.view, height_m).encode(), "text/plain; charset=utf-8")
    layer = found.layer(request().query_params.get("layer"))
    template = xyz_template(found, public_url(), layer, suffix_of(layer.media_type))
    make = qgis_layer if suffix == "qlr" else gdal_wms
    return document(make(manifest, found.view, layer, template, height_m).encode(), "application/xml")


def _height() -> float | None:
    text = request().query_params.get("height")
    if text is None:
        return None
    try:
        return check_height(float(text)) if len(text) <= MAX_NUMBER and text.isascii() else check_height(math.nan)
    except ValueError:
        raise BadRequest(f"height {text!r:.70} is not a number") from None


def _view(view_id: str) -> TiledView:
    rendering, separator, _ = view_id.partition(":")
    if not separator:
        raise NotOffered(f"no collection {view_id!r:.150}; a collection is <rendering>:<view>")
    return site().views.view(rendering, view_id)


def _web_mercator_view() -> TiledView:
    """Returns the view with the most levels."""
    all_views = [view for view in site().views.all() if view.pseudo]
    if not all_views:
        raise NotOffered("no rendering has tiles of 256 px, as WebMercatorQuad requires")
    return max(all_views, key=lambda view: view.manifest.zmax)


def _layer(view: TiledView, style: str | None) -> Layer | None:
    return None if style is None else view.layer(style)


def _ogc() -> str:
    return public_url("ogc")


def _json(value: Any, media_type: str = _JSON) -> Response:
    if request().query_params.get("f", "json") != "json":
        raise BadRequest(f"f={request().query_params['f']!r:.70}: this document is available as json")
    return document(json.dumps(value, ensure_ascii=False, allow_nan=False).encode(), media_type)
