"""The JSON documents of OGC API – Tiles (OGC 20-057) and the Two Dimensional Tile Matrix Set standard (OGC 17-083r4).

`root` is the absolute URL of the landing page, without a slash at its end. A tile matrix set also has the names of version 1 of the standard, because
GDAL 3.6 reads no others.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final
from urllib.parse import quote

from map3d.tile_services.tile_formats import media_types_of, suffix_of
from map3d.tile_services.tiled_view import WEB_MERCATOR, WEB_MERCATOR_CRS, WEB_MERCATOR_URI, TiledView, TileMatrix
from map3d.types import Layer

Json = dict[str, Any]

REL: Final = "http://www.opengis.net/def/rel/ogc/1.0"
TITLE: Final = "map3d: oblique tiles of 3D city models"
_SPEC: Final = "http://www.opengis.net/spec"
CONFORMANCE: Final = (
    *(f"{_SPEC}/ogcapi-common-1/1.0/conf/{name}" for name in ("core", "landing-page", "json", "oas30")),
    f"{_SPEC}/ogcapi-common-2/1.0/conf/collections",
    *(f"{_SPEC}/ogcapi-tiles-1/1.0/conf/{name}" for name in ("core", "tileset", "tilesets-list", "geodata-tilesets", "png", "jpeg", "oas30")),
    *(
        f"{_SPEC}/tms/2.0/conf/{name}"
        for name in ("tilematrixset", "json-tilematrixset", "tilesetmetadata", "json-tilesetmetadata", "tilematrixsetlimits")
    ),
)


def link(href: str, rel: str, title: str, media_type: str = "application/json", **more: object) -> Json:
    return {"href": href, "rel": rel, "type": media_type, "title": title, **more}


def landing_page(root: str) -> Json:
    return {
        "title": TITLE,
        "description": "The colour layers of oblique views as map tiles. A collection is one view of one rendering.",
        "links": [
            link(root, "self", "this document"),
            link(f"{root}/api", "service-desc", "API definition", "application/vnd.oai.openapi+json;version=3.0"),
            link(f"{root}/conformance", "conformance", "conformance classes"),
            link(f"{root}/conformance", f"{REL}/conformance", "conformance classes"),
            link(f"{root}/collections", "data", "collections"),
            link(f"{root}/collections", f"{REL}/data", "collections"),
            link(f"{root}/tileMatrixSets", f"{REL}/tiling-schemes", "tile matrix sets"),
        ],
    }


def conformance() -> Json:
    return {"conformsTo": list(CONFORMANCE)}


def collections(views: Iterable[TiledView], root: str) -> Json:
    return {"links": [link(f"{root}/collections", "self", "this document")], "collections": [collection(view, root) for view in views]}


def collection(view: TiledView, root: str) -> Json:
    at = collection_url(view, root)
    extent = view.lon_lat_extent
    return {
        "id": view.id,
        "title": view.title,
        "description": view.description,
        "attribution": view.manifest.attribution,
        **({} if extent is None else {"extent": {"spatial": {"bbox": [list(extent)], "crs": "http://www.opengis.net/def/crs/OGC/1.3/CRS84"}}}),
        "links": [
            link(at, "self", "this document"),
            link(f"{at}/map/tiles", f"{REL}/tilesets-map", "tile sets of the default layer"),
            link(f"{at}/styles", f"{REL}/styles", "colour layers"),
        ],
    }


def styles(view: TiledView, root: str) -> Json:
    """Returns the colour layers of a view. They have a document of their own, because GDAL takes any one of several links to tile sets."""
    return {
        "default": view.layers[0].name,
        "links": [link(f"{collection_url(view, root)}/styles", "self", "this document")],
        "styles": [
            {
                "id": layer.name,
                "title": layer.name,
                "links": [link(tile_sets_url(view, root, layer), f"{REL}/tilesets-map", f"tile sets of layer {layer.name}")],
            }
            for layer in view.layers
        ],
    }


def collection_url(view: TiledView, root: str) -> str:
    return f"{root}/collections/{quote(view.id, safe=':')}"


def tile_sets_url(view: TiledView, root: str, layer: Layer | None) -> str:
    """`layer`: None for the default layer, whose URLs name none."""
    return collection_url(view, root) + ("" if layer is None else f"/styles/{layer.name}") + "/map/tiles"


def tile_sets(view: TiledView, root: str, layer: Layer | None) -> Json:
    return {
        "links": [link(tile_sets_url(view, root, layer), "self", "this document")],
        "tilesets": [_tile_set_item(view, root, layer)],
    }


def tile_set(view: TiledView, root: str, layer: Layer | None) -> Json:
    """Returns the metadata of a tile set."""
    left, bottom, right, top = view.extent
    crs = _crs(view)
    shown = layer or view.layers[0]
    return {
        **_tile_set_item(view, root, layer),
        "description": view.description,
        "attribution": view.manifest.attribution,
        "version": str(view.manifest.content_version),
        "mediaTypes": list(media_types_of(shown)),
        "boundingBox": {"lowerLeft": [left, bottom], "upperRight": [right, top], "crs": crs},
        "layers": [{"id": view.id, "title": view.title, "dataType": "map"}],
        "style": {"id": shown.name, "title": shown.name},
        "centerPoint": {"coordinates": [(left + right) / 2, (bottom + top) / 2], "crs": crs, "tileMatrix": str(view.manifest.zmax)},
    }


def _tile_set_item(view: TiledView, root: str, layer: Layer | None) -> Json:
    tile_matrix_set = view.tile_matrix_set
    at = f"{tile_sets_url(view, root, layer)}/{quote(tile_matrix_set, safe=':')}"
    uri = tile_matrix_set_uri(tile_matrix_set, root)
    template = at + "/{tileMatrix}/{tileRow}/{tileCol}?f="
    return {
        "title": view.title,
        "dataType": "map",
        "crs": _crs(view),
        "tileMatrixSetURI": uri,
        "tileMatrixSetId": tile_matrix_set,
        "tileMatrixSetLimits": [_limits(matrix) for matrix in view.matrices],
        "links": [
            link(at, "self", "tile set"),
            link(tile_matrix_set_url(tile_matrix_set, root), f"{REL}/tiling-scheme", "tile matrix set"),
            link(collection_url(view, root), f"{REL}/geodata", "collection"),
            *(
                link(template + suffix_of(media_type), "item", f"tile as {media_type}", media_type, templated=True)
                for media_type in media_types_of(layer or view.layers[0])
            ),
        ],
    }


def _limits(matrix: TileMatrix) -> Json:
    """Names all tiles of a level: GDAL 3.6 places tiles wrongly when the limits of rows are narrower."""
    return {
        "tileMatrix": str(matrix.level),
        "minTileRow": 0,
        "maxTileRow": matrix.count - 1,
        "minTileCol": 0,
        "maxTileCol": matrix.count - 1,
    }


def tile_matrix_set_url(tile_matrix_set: str, root: str) -> str:
    return f"{root}/tileMatrixSets/{quote(tile_matrix_set, safe=':')}"


def tile_matrix_set_uri(tile_matrix_set: str, root: str) -> str:
    return WEB_MERCATOR_URI if tile_matrix_set == WEB_MERCATOR else tile_matrix_set_url(tile_matrix_set, root)


def tile_matrix_sets(views: Sequence[TiledView], root: str) -> Json:
    titles = {view.tile_matrix_set: _tile_matrix_set_title(view) for view in views}
    return {
        "links": [link(f"{root}/tileMatrixSets", "self", "this document")],
        "tileMatrixSets": [
            {
                "id": name,
                "title": title,
                "uri": tile_matrix_set_uri(name, root),
                "links": [link(tile_matrix_set_url(name, root), "self", title), link(tile_matrix_set_url(name, root), f"{REL}/tiling-scheme", title)],
            }
            for name, title in titles.items()
        ],
    }


def tile_matrix_set(view: TiledView, root: str) -> Json:
    """Returns the definition, with the levels of this view."""
    name, crs = view.tile_matrix_set, _crs(view)
    whole = view.matrices[0]
    (left, top), side = whole.origin, whole.cell_size * whole.tile_px
    return {
        "id": name,
        "title": _tile_matrix_set_title(view),
        "uri": tile_matrix_set_uri(name, root),
        "orderedAxes": ["X", "Y"] if view.pseudo else ["E", "N"],
        "crs": crs,
        **({"wellKnownScaleSet": "http://www.opengis.net/def/wkss/OGC/1.0/GoogleMapsCompatible"} if view.pseudo else {}),
        "boundingBox": {
            "type": "BoundingBoxType",
            "crs": crs,
            "lowerLeft": [left, top - side],
            "upperRight": [left + side, top],
            "lowerCorner": [left, top - side],
            "upperCorner": [left + side, top],
        },
        "tileMatrices": [_tile_matrix(matrix) for matrix in view.matrices],
        "type": "TileMatrixSetType",
        "identifier": name,
        "supportedCRS": WEB_MERCATOR_CRS if view.pseudo else view.crs().to_wkt(),
        "tileMatrix": [_tile_matrix_1(matrix) for matrix in view.matrices],
    }


def _tile_matrix(matrix: TileMatrix) -> Json:
    return {
        "id": str(matrix.level),
        "scaleDenominator": matrix.scale_denominator,
        "cellSize": matrix.cell_size,
        "cornerOfOrigin": "topLeft",
        "pointOfOrigin": list(matrix.origin),
        **_tile_matrix_size(matrix),
    }


def _tile_matrix_1(matrix: TileMatrix) -> Json:
    return {
        "type": "TileMatrixType",
        "identifier": str(matrix.level),
        "scaleDenominator": matrix.scale_denominator,
        "topLeftCorner": list(matrix.origin),
        **_tile_matrix_size(matrix),
    }


def _tile_matrix_size(matrix: TileMatrix) -> Json:
    return {"tileWidth": matrix.tile_px, "tileHeight": matrix.tile_px, "matrixWidth": matrix.count, "matrixHeight": matrix.count}


def _tile_matrix_set_title(view: TiledView) -> str:
    return "Google Maps Compatible for the World" if view.pseudo else f"{view.title}, plane of the view"


def _crs(view: TiledView) -> Any:
    """Returns a URI, or the definition as PROJJSON: no authority has registered the planes of views."""
    return WEB_MERCATOR_CRS if view.pseudo else {"wkt": view.crs().to_json_dict()}
