"""TileJSON 3.0.0, which MapLibre reads: tiles in pseudo Web Mercator."""

from map3d.tile_services.ogc_documents import Json
from map3d.tile_services.tile_formats import suffix_of
from map3d.tile_services.tiled_view import PSEUDO, PSEUDO_NOTE, TiledView
from map3d.types import Layer


def xyz_template(view: TiledView, root: str, layer: Layer, suffix: str) -> str:
    """Returns the URL template of a layer's tiles. `root`: absolute URL of the server."""
    return f"{root}/xyz/{view.manifest.name}/{view.view.frame.id}/{layer.name}/{{z}}/{{x}}/{{y}}.{suffix}"


def tilejson(view: TiledView, root: str, layer: Layer) -> Json:
    west, south, east, north = view.pseudo_lon_lat_extent()
    return {
        "tilejson": "3.0.0",
        "name": f"{view.manifest.title or view.manifest.name}: view {view.view.frame.id} ({PSEUDO})",
        "description": f"{PSEUDO_NOTE} {view.description}",
        "version": f"{view.manifest.content_version}.0.0",
        "attribution": _html_text(view.manifest.attribution),
        "tiles": [xyz_template(view, root, layer, suffix_of(layer.media_type))],
        "scheme": "xyz",
        "minzoom": 0,
        "maxzoom": view.manifest.zmax,
        "bounds": [west, south, east, north],
        "center": [(west + east) / 2, (south + north) / 2, max(view.manifest.zmax - 2, 0)],
        "vector_layers": [],
    }


def _html_text(text: str) -> str:
    """Returns text for a place where clients expect HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
