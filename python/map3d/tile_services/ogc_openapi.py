"""The API definition of OGC API – Tiles, OpenAPI 3.0. The standard prescribes the endings of the operation ids (requirement 23)."""

from typing import Any, Final

from map3d import __version__
from map3d.tile_services.ogc_documents import TITLE, Json

_TEXT: Final = {"schema": {"type": "string"}}
_PARAMETERS: Final[dict[str, tuple[str, Json]]] = {
    "collectionId": ("a view of a rendering: <rendering>:<view>", {"type": "string"}),
    "styleId": ("a colour layer of the view", {"type": "string"}),
    "tileMatrixSetId": ("the id of the collection, or WebMercatorQuad", {"type": "string"}),
    "tileMatrix": ("level, from 0", {"type": "string"}),
    "tileRow": ("row of the tile, from the top", {"type": "integer", "minimum": 0}),
    "tileCol": ("column of the tile, from the left", {"type": "integer", "minimum": 0}),
}


def definition(root: str) -> Json:
    return {
        "openapi": "3.0.3",
        "info": {"title": TITLE, "version": __version__, "license": {"name": "Apache-2.0"}},
        "servers": [{"url": root}],
        "paths": _paths(),
        "components": {"parameters": {name: _parameter(name) for name in _PARAMETERS}, "responses": _ERRORS},
    }


_ERRORS: Final = {
    "NotFound": {"description": "no such resource", "content": {"text/plain": _TEXT, "application/problem+json": {"schema": {"type": "object"}}}},
    "BadRequest": {"description": "a parameter has no such value", "content": {"text/plain": _TEXT}},
}


def _parameter(name: str) -> Json:
    description, schema = _PARAMETERS[name]
    return {"name": name, "in": "path", "required": True, "description": description, "schema": schema}


def _paths() -> Json:
    paths = {
        "/": _get("getLandingPage", "landing page"),
        "/conformance": _get("getConformance", "conformance classes"),
        "/api": _get("getApi", "this document"),
        "/collections": _get("getCollections", "the views of all renderings"),
        "/collections/{collectionId}": _get("getCollection", "one view", "collectionId"),
        "/collections/{collectionId}/styles": _get("getStyles", "the colour layers of a view", "collectionId"),
        "/tileMatrixSets": _get("getTileMatrixSetsList", "tile matrix sets"),
        "/tileMatrixSets/{tileMatrixSetId}": _get("getTileMatrixSet", "one tile matrix set", "tileMatrixSetId"),
    }
    for base, names, prefix in (
        ("/collections/{collectionId}", ("collectionId",), ".collection"),
        ("/collections/{collectionId}/styles/{styleId}", ("collectionId", "styleId"), ".collection.style"),
    ):
        at = f"{base}/map/tiles"
        paths[at] = _get(f"{prefix}.map.getTileSetsList", "tile sets", *names)
        paths[f"{at}/{{tileMatrixSetId}}"] = _get(f"{prefix}.map.getTileSet", "metadata of a tile set", *names, "tileMatrixSetId")
        paths[f"{at}/{{tileMatrixSetId}}/{{tileMatrix}}/{{tileRow}}/{{tileCol}}"] = _get_tile(f"{prefix}.map.getTile", names)
    return paths


def _get(operation: str, summary: str, *parameters: str, content: Any = None) -> Json:
    row: Json = {
        "operationId": operation,
        "summary": summary,
        "parameters": [{"$ref": f"#/components/parameters/{name}"} for name in parameters],
        "responses": {
            "200": {"description": summary, "content": content or {"application/json": {"schema": {"type": "object"}}}},
            "404": {"$ref": "#/components/responses/NotFound"},
        },
    }
    return {"get": row}


def _get_tile(operation: str, parameters: tuple[str, ...]) -> Json:
    image = {media_type: {"schema": {"type": "string", "format": "binary"}} for media_type in ("image/webp", "image/png", "image/jpeg")}
    path = _get(operation, "a tile", *parameters, "tileMatrixSetId", "tileMatrix", "tileRow", "tileCol", content=image)
    formats = {"type": "string", "enum": ["png", "webp", "jpg"]}
    path["get"]["parameters"].append({"name": "f", "in": "query", "description": "format, by default the stored one", "schema": formats})
    path["get"]["responses"]["400"] = {"$ref": "#/components/responses/BadRequest"}
    return path
