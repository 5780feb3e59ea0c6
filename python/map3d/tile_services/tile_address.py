"""Parses the URLs of tiles: XYZ, OGC API – Tiles, and WMTS with RESTful URLs or key-value pairs."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal
from urllib.parse import parse_qsl

from map3d.errors import BadRequest
from map3d.tile_services.tile_formats import check_media_type, parse_suffix
from map3d.tile_services.tiled_view import NotOffered, TiledView
from map3d.tiles.naming import parse_tile
from map3d.types import Layer, TileId

Service = Literal["xyz", "ogc", "wmts"]

XYZ: Final = "/xyz/"
OGC: Final = "/ogc/collections/"
WMTS: Final = "/wmts"
WMTS_REST: Final = "/wmts/1.0.0/"
MAX_QUERY_BYTES: Final = 4096
MAX_FIELDS: Final = 64
_OGC: Final = re.compile(r"/ogc/collections/([^/:]+):([^/]+)(?:/styles/([^/]+))?/map/tiles/([^/]+)/([^/]+)/([^/]+)/([^/]+)")
_XYZ: Final = re.compile(r"/xyz/([^/]+)/([^/]+)(?:/([^/]+))?/([^/]+)/([^/]+)/([^/.]+)\.([a-z]+)")
_WMTS: Final = re.compile(r"/wmts/1\.0\.0/([^/:]+):([^/]+)/([^/]+)/([^/]+)/([^/]+)/([^/]+)/([^/.]+)\.([a-z]+)")


class InvalidParameter(BadRequest):
    """A parameter of a WMTS request is missing or has no such value."""

    def __init__(self, code: str, locator: str, text: str) -> None:
        super().__init__(text)
        self.code, self.locator = code, locator


@dataclass(frozen=True)
class TileAddress:
    """`layer`, `media_type`: None for the defaults of the view; `tile_matrix_set`: None for XYZ, which has no limits."""

    service: Service
    rendering: str
    view: str
    layer: str | None
    tile_matrix_set: str | None
    tile: TileId
    media_type: str | None

    @property
    def view_id(self) -> str:
        return f"{self.rendering}:{self.view}"


def is_tile_url(path: str, query: bytes) -> bool:
    """Whether the URL is that of a tile, well-formed or not."""
    if path.startswith(XYZ):
        return True
    if path.startswith(OGC):
        return "/map/tiles/" in path and path.partition("/map/tiles/")[2].count("/") == 3
    if path.startswith(WMTS_REST):
        return path.count("/") == 8
    return path == WMTS and b"gettile" in query[:MAX_QUERY_BYTES].lower()


def parse_tile_address(path: str, query: bytes) -> TileAddress:
    """Raises NotOffered for a path that names no tile, BadRequest for parameters."""
    if path.startswith(XYZ):
        return _parse_xyz(path)
    if path.startswith(OGC):
        return _parse_ogc(path, query)
    return _parse_wmts(path) if path.startswith(WMTS_REST) else _parse_key_value_pairs(query)


def resolve_tile(address: TileAddress, view: TiledView) -> tuple[Layer, str]:
    """Returns the layer and the media type of a tile. Raises NotOffered for a layer or tile that the view lacks, BadRequest for the format."""
    layer = view.layer(address.layer)
    media_type = layer.media_type if address.media_type is None else check_media_type(layer, address.media_type)
    z, column, row = address.tile
    if z > view.manifest.zmax:
        raise NotOffered(f"no level {z}; the deepest level of {view.id} is {view.manifest.zmax}")
    if address.tile_matrix_set is not None:
        view.check_tile_matrix_set(address.tile_matrix_set)
        matrix = view.matrices[z]
        if address.service == "wmts" and not matrix.holds(column, row):
            raise InvalidTile(
                f"tile {z}/{row}/{column} is out of range; level {z} has rows {matrix.min_row} to {matrix.max_row} "
                f"and columns {matrix.min_column} to {matrix.max_column}"
            )
    return layer, media_type


class InvalidTile(NotOffered):
    """A tile is outside the limits of a tile set."""


def _parse_xyz(path: str) -> TileAddress:
    match = _XYZ.fullmatch(path)
    tile = parse_tile(match[4], match[5], match[6]) if match else None
    media_type = parse_suffix(match[7]) if match else None
    if match is None or tile is None or media_type is None:
        raise NotOffered("not a tile URL; expected /xyz/<rendering>/<view>[/<layer>]/<z>/<x>/<y>.<png|webp|jpg> with 0 ≤ x, y < 2^z")
    return TileAddress("xyz", match[1], match[2], match[3], None, tile, media_type)


def _parse_ogc(path: str, query: bytes) -> TileAddress:
    match = _OGC.fullmatch(path)
    tile = parse_tile(match[5], match[7], match[6]) if match else None
    if match is None or tile is None:
        raise NotOffered("not a tile URL; expected …/map/tiles/<tile matrix set>/<level>/<row>/<column> with 0 ≤ row, column < 2^level")
    return TileAddress("ogc", match[1], match[2], match[3], match[4], tile, _parse_f(query))


def _parse_f(query: bytes) -> str | None:
    text = _parse_query(query).get("f")
    media_type = None if text is None else parse_suffix(text.lower())
    if text is not None and media_type is None:
        raise BadRequest(f"f={text:.70}: unknown format; expected png, webp or jpg")
    return media_type


def _parse_wmts(path: str) -> TileAddress:
    match = _WMTS.fullmatch(path)
    media_type = parse_suffix(match[8]) if match else None
    if match is None or media_type is None:
        raise InvalidParameter(
            "InvalidParameterValue", "path", "expected /wmts/1.0.0/<layer>/<style>/<tile matrix set>/<tile matrix>/<row>/<column>.<png|webp|jpg>"
        )
    return _wmts_address(match[1], match[2], match[3], match[4], (match[5], match[7], match[6]), media_type)


def _parse_key_value_pairs(query: bytes) -> TileAddress:
    pairs = {key.lower(): value for key, value in _parse_query(query).items()}
    for key, expected in (("service", "wmts"), ("version", "1.0.0")):
        if pairs.get(key, expected).lower() != expected:
            raise InvalidParameter("InvalidParameterValue", key.upper(), f"{key.upper()} is {pairs[key]!r:.70}, expected {expected.upper()}")
    rendering, _, view = _required(pairs, "layer").partition(":")
    media_type = _required(pairs, "format")
    numbers = (_required(pairs, "tilematrix"), _required(pairs, "tilecol"), _required(pairs, "tilerow"))
    return _wmts_address(rendering, view, pairs.get("style", ""), _required(pairs, "tilematrixset"), numbers, media_type)


def _wmts_address(rendering: str, view: str, style: str, tile_matrix_set: str, numbers: tuple[str, str, str], media_type: str) -> TileAddress:
    """`numbers`: level, column and row. An empty style, or `default`, means the default layer."""
    tile = parse_tile(*numbers)
    if tile is None:
        raise InvalidParameter("TileOutOfRange", "TileRow", "expected a tile matrix from 0 and a row and column from 0 to 2^level - 1")
    return TileAddress("wmts", rendering, view, None if style in ("", "default") else style, tile_matrix_set, tile, media_type)


def _required(pairs: Mapping[str, str], key: str) -> str:
    value = pairs.get(key, "")
    if not value:
        raise InvalidParameter("MissingParameterValue", key.upper(), f"parameter {key.upper()} is missing")
    return value


def _parse_query(query: bytes) -> dict[str, str]:
    if len(query) > MAX_QUERY_BYTES:
        raise BadRequest(f"the query has {len(query):,} bytes, expected at most {MAX_QUERY_BYTES:,}")
    try:
        return dict(parse_qsl(query.decode("ascii", "replace"), keep_blank_values=True, max_num_fields=MAX_FIELDS))
    except ValueError:
        raise BadRequest(f"the query has more than {MAX_FIELDS} parameters") from None
