"""Tiles for GIS software and map libraries: XYZ, OGC API – Tiles and WMTS. Plain ASGI in front of the tile route, which finds and caches the tiles.

Other than the tile route, it answers an empty tile with an image, because most clients report an error for an answer without one, and it converts
WebP and JPEG to PNG for clients that ask for PNG.
"""

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Final

from starlette.exceptions import HTTPException
from starlette.responses import Response

from map3d.errors import BadRequest, NotFound
from map3d.tile_services.tile_address import InvalidParameter, InvalidTile, TileAddress, is_tile_url, parse_tile_address, resolve_tile
from map3d.tile_services.tile_formats import convert_tile, empty_tile, suffix_of
from map3d.tile_services.tiled_view import TiledView
from map3d.tile_services.wmts import exception_report
from map3d.tiles.manifest import block_version
from map3d.types import Layer
from map3d.web.http.asgi import Receive, Scope, Send
from map3d.web.http.byte_lru import ByteLru
from map3d.web.http.headers import ANY_ORIGIN, IMMUTABLE, NO_CACHE
from map3d.web.http.http_errors import error_headers, not_allowed, plain_error, status_of
from map3d.web.http.tiled_views import TiledViews
from map3d.web.tiles.tile_route import KeptResponse, TileRoute, for_client

THREADS: Final = 2
DEFAULT_CACHE_BYTES: Final = 32 << 20
"""Memory for converted tiles."""


class TileServiceRoute:
    """Belongs to one event loop."""

    def __init__(self, tiles: TileRoute, views: TiledViews, cache_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self._tiles, self._views = tiles, views
        self._converted: ByteLru[tuple[bytes, str], bytes] = ByteLru(cache_bytes)
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="tile-services")

    def answers(self, scope: Scope) -> bool:
        return is_tile_url(scope["path"], scope["query_string"])

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            if scope["method"] not in ("GET", "HEAD"):
                raise not_allowed("GET", "HEAD")
            address = parse_tile_address(scope["path"], scope["query_string"])
            view = await self._find_view(address)
            layer, media_type = resolve_tile(address, view)
            tile = _adapt(await self._tiles.find(_tile_key(address, view, layer), receive), view.manifest.tile_px, media_type)
            if tile.etag and media_type != layer.media_type:
                tile = await self._convert(tile, media_type)
        except Exception as error:
            await _error_response(scope["path"], error)(scope, receive, send)
            return
        for message in for_client(tile, scope).messages:
            await send(message)

    async def close(self) -> None:
        self._threads.shutdown(cancel_futures=True)

    async def _find_view(self, address: TileAddress) -> TiledView:
        view = self._views.known_view(address.rendering, address.view_id)
        if view is not None:
            return view
        return await asyncio.get_running_loop().run_in_executor(self._threads, self._views.view, address.rendering, address.view_id)

    async def _convert(self, tile: KeptResponse, media_type: str) -> KeptResponse:
        """Returns the tile with its picture in the media type."""
        data = self._converted.get((tile.etag, media_type))
        if data is None:
            data = await asyncio.get_running_loop().run_in_executor(self._threads, convert_tile, tile.body, media_type)
            self._converted.put((tile.etag, media_type), data, len(data))
        etag = b'%s-%s"' % (tile.etag[:-1], suffix_of(media_type).encode())
        replaced = {b"content-type": media_type.encode(), b"content-length": str(len(data)).encode(), b"etag": etag}
        return KeptResponse(200, [(name, replaced.get(name, value)) for name, value in tile.headers], data, etag)


def _adapt(tile: KeptResponse, tile_px: int, media_type: str) -> KeptResponse:
    """Returns the tile, an image in the place of an empty one, without permission to cache forever: the URL has no version."""
    headers = [(name, NO_CACHE if value == IMMUTABLE else value) for name, value in tile.headers]
    if tile.status != 204:
        return replace(tile, headers=headers)
    image = empty_tile(tile_px, media_type)
    return KeptResponse(200, [*headers, (b"content-type", media_type.encode()), (b"content-length", str(len(image)).encode())], image)


def _tile_key(address: TileAddress, view: TiledView, layer: Layer) -> tuple[str, bytes]:
    """Returns the key of the tile with the version of its block: then the tile route keeps the tile in memory."""
    number = next(number for number, layers in enumerate(view.manifest.passes) if layer in layers)
    z, x, y = address.tile
    return f"/{view.manifest.name}/{view.view.frame.id}/{layer.name}/{z}/{x}/{y}", b"v=%d" % block_version(view.view, address.tile, number)


def _error_response(path: str, error: Exception) -> Response:
    """Returns an error as the service of the path writes it."""
    if not path.startswith(("/ogc", "/wmts")) or (path.startswith("/wmts") and isinstance(error, HTTPException)):
        return plain_error(error, ANY_ORIGIN)
    status, text = status_of(error)
    headers = {**ANY_ORIGIN, **error_headers(error)}
    if path.startswith("/ogc"):
        return Response(json.dumps({"title": text, "status": status}), status, headers, "application/problem+json")
    code, locator = _wmts_code(error)
    return Response(exception_report(code, text, locator), 400 if code != "NoApplicableCode" else status, {"Content-Type": "text/xml", **headers})


def _wmts_code(error: Exception) -> tuple[str, str | None]:
    """Returns the code and the locator of an exception report."""
    if isinstance(error, InvalidParameter):
        return error.code, error.locator
    if isinstance(error, InvalidTile):
        return "TileOutOfRange", "TileRow"
    if isinstance(error, NotFound):
        return "InvalidParameterValue", "Layer"
    return ("InvalidParameterValue", "Format") if isinstance(error, BadRequest) else ("NoApplicableCode", None)
