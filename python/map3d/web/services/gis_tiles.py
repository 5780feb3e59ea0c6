"""Tiles for GIS software and map libraries: XYZ, OGC API – Tiles and WMTS. Plain ASGI in front of the tile route, which finds and caches the tiles.

Other than the tile route, it answers an empty tile with an image, because most clients report an error for an answer without one, and it converts
WebP and JPEG to PNG for clients that ask for PNG.
"""

import asyncio
import json
from collections.abc import Awaitable, Callable, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

from map3d.errors import BadRequest, NotFound
from map3d.tile_services.tile_address import InvalidParameter, InvalidTile, TileAddress, is_tile_url, parse_tile_address, resolve_tile
from map3d.tile_services.tile_formats import convert_tile, empty_tile, suffix_of
from map3d.tile_services.tiled_view import TiledView
from map3d.tile_services.wmts import exception_report
from map3d.tiles.manifest import block_version
from map3d.types import Layer
from map3d.web.http.byte_lru import ByteLru
from map3d.web.http.http_errors import status_of
from map3d.web.tiles.tile_route import COMMON, NO_STORE, Headers, Receive, Scope, Send, etag_matches
from map3d.web.tiles.tiled_views import TiledViews

Application = Callable[[Scope, Receive, Send], Awaitable[None]]

THREADS: Final = 2
DEFAULT_CACHE_BYTES: Final = 32 << 20
"""Memory for converted tiles."""
NO_CACHE: Final = b"no-cache"


@dataclass(frozen=True)
class _Answer:
    status: int
    headers: Headers
    body: bytes


class TileServiceRoute:
    """Belongs to one event loop."""

    def __init__(self, tiles: Application, views: TiledViews, cache_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self._tiles, self._views = tiles, views
        self._converted: ByteLru[tuple[bytes, str], bytes] = ByteLru(cache_bytes)
        self._threads = ThreadPoolExecutor(THREADS, thread_name_prefix="tile-services")

    def matches(self, path: str, query: bytes) -> bool:
        return is_tile_url(path, query)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        head = scope["method"] == "HEAD"
        if scope["method"] not in ("GET", "HEAD"):
            await _send(send, _error(scope["path"], 405, "method not allowed; use GET or HEAD", [(b"allow", b"GET, HEAD")]), head=False)
            return
        try:
            address = parse_tile_address(scope["path"], scope["query_string"])
            view = await self._find_view(address)
            layer, media_type = resolve_tile(address, view)
        except Exception as error:
            await _send(send, _error_answer(scope["path"], error), head=head)
            return
        inner = _tile_scope(scope, address, view, layer)
        if media_type == layer.media_type:
            await self._tiles(inner, receive, _Relay(send, view.manifest.tile_px, media_type, head=head))
        else:
            await self._send_converted(inner, receive, send, view.manifest.tile_px, media_type, head=head)

    async def close(self) -> None:
        self._threads.shutdown(cancel_futures=True)
        self._views.close()

    async def _find_view(self, address: TileAddress) -> TiledView:
        view = self._views.known_view(address.rendering, address.view_id)
        if view is not None:
            return view
        return await asyncio.get_running_loop().run_in_executor(self._threads, self._views.view, address.rendering, address.view_id)

    async def _send_converted(self, scope: Scope, receive: Receive, send: Send, tile_px: int, media_type: str, *, head: bool) -> None:
        asked = _header(scope["headers"], b"if-none-match")
        kept = [pair for pair in scope["headers"] if pair[0] not in (b"if-none-match", b"range", b"if-range")]
        collected = _Collector()
        await self._tiles({**scope, "method": "GET", "headers": kept}, receive, _Relay(collected, tile_px, media_type, head=False))
        answer = _Answer(collected.status, collected.headers, b"".join(collected.body))
        etag = _header(answer.headers, b"etag")
        if answer.status == 200 and _header(answer.headers, b"content-type") != media_type.encode():
            try:
                answer = await self._convert(answer, etag, media_type)
            except Exception as error:
                answer = _error_answer(scope["path"], error)
        if etag_matches(asked, _header(answer.headers, b"etag")):
            answer = _Answer(304, [pair for pair in answer.headers if pair[0] not in (b"content-length", b"content-type")], b"")
        await _send(send, answer, head=head)

    async def _convert(self, answer: _Answer, etag: bytes, media_type: str) -> _Answer:
        data = self._converted.get((etag, media_type))
        if data is None:
            data = await asyncio.get_running_loop().run_in_executor(self._threads, convert_tile, answer.body, media_type)
            self._converted.put((etag, media_type), data, len(data))
        replaced = {
            b"content-type": media_type.encode(),
            b"content-length": str(len(data)).encode(),
            b"etag": etag[:-1] + b"-" + suffix_of(media_type).encode() + b'"',
        }
        headers = [(name, replaced.get(name, value)) for name, value in answer.headers if name != b"accept-ranges"]
        return _Answer(200, headers, data)


class _Relay:
    """Forwards the answer of the tile route, with an image in place of an empty tile, and without permission to cache forever: the URL has no
    version."""

    def __init__(self, send: Send, tile_px: int, media_type: str, *, head: bool) -> None:
        self._send, self._tile_px, self._media_type, self._head = send, tile_px, media_type, head
        self._image: bytes | None = None

    async def __call__(self, message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            headers = [(name, NO_CACHE if name == b"cache-control" and value != NO_STORE else value) for name, value in message["headers"]]
            status = message["status"]
            if status == 204:
                status, self._image = 200, empty_tile(self._tile_px, self._media_type)
                headers += [(b"content-type", self._media_type.encode()), (b"content-length", str(len(self._image)).encode())]
            message = {**message, "status": status, "headers": headers}
        elif self._image is not None:
            message = {**message, "body": b"" if self._head else self._image}
        await self._send(message)


class _Collector:
    """Keeps an answer in memory."""

    def __init__(self) -> None:
        self.status, self.headers = 500, Headers()
        self.body: list[bytes] = []

    async def __call__(self, message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            self.status, self.headers = message["status"], message["headers"]
        else:
            self.body.append(message.get("body", b""))


def _tile_scope(scope: Scope, address: TileAddress, view: TiledView, layer: Layer) -> Scope:
    """Returns the scope of the tile's own URL, with the version of its block: then the tile route keeps the tile in memory."""
    number = next(number for number, layers in enumerate(view.manifest.passes) if layer in layers)
    version = block_version(view.view, address.tile, number)
    z, x, y = address.tile
    path = f"/tiles/{view.manifest.name}/{view.view.frame.id}/{layer.name}/{z}/{x}/{y}"
    return {**scope, "path": path, "raw_path": path.encode(), "query_string": f"v={version}".encode()}


def _error_answer(path: str, error: Exception) -> _Answer:
    status, text = status_of(error)
    if not path.startswith("/wmts"):
        return _error(path, status, text)
    code, locator = _wmts_code(error)
    return _problem(400 if code != "NoApplicableCode" else status, "text/xml", exception_report(code, text, locator))


def _wmts_code(error: Exception) -> tuple[str, str | None]:
    """Returns the code and the locator of an exception report."""
    if isinstance(error, InvalidParameter):
        return error.code, error.locator
    if isinstance(error, InvalidTile):
        return "TileOutOfRange", "TileRow"
    if isinstance(error, NotFound):
        return "InvalidParameterValue", "Layer"
    return ("InvalidParameterValue", "Format") if isinstance(error, BadRequest) else ("NoApplicableCode", None)


def _error(path: str, status: int, text: str, more: Headers | None = None) -> _Answer:
    if path.startswith("/ogc"):
        return _problem(status, "application/problem+json", json.dumps({"title": text, "status": status}).encode(), more)
    return _problem(status, "text/plain; charset=utf-8", f"{text}\n".encode(), more)


def _problem(status: int, media_type: str, body: bytes, more: Headers | None = None) -> _Answer:
    headers = [(b"content-type", media_type.encode()), (b"content-length", str(len(body)).encode()), (b"cache-control", NO_STORE)]
    return _Answer(status, [*headers, *COMMON, *(more or [])], body)


async def _send(send: Send, answer: _Answer, *, head: bool) -> None:
    await send({"type": "http.response.start", "status": answer.status, "headers": answer.headers})
    await send({"type": "http.response.body", "body": b"" if head else answer.body})


def _header(headers: Headers, name: bytes) -> bytes:
    return b",".join(value for key, value in headers if key == name)
