"""The tile route (spec/manifest.md, Tile URL): plain ASGI with a bounded memory cache, because a framework costs too much per tile."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

from map3d.catalogue.workspace import Workspace
from map3d.tiles.naming import block_of, parse_tile
from map3d.tiles.tile_store import StoredBlock, content_hash
from map3d.types import TileId
from map3d.web.byte_lru import ByteLru
from map3d.web.http_errors import status_of
from map3d.web.open_stores import OpenStore, OpenStores

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]

PREFIXES: Final = ("/tiles/", "/view/")
"""The viewer's page loads tiles relative to its own folder, hence the second one."""

DEFAULT_CACHE_BYTES: Final = 128 << 20
READING_THREADS: Final = 4
IMMUTABLE: Final = b"public, max-age=31536000, immutable"
NO_CACHE: Final = b"no-cache"
NO_STORE: Final = b"no-store"
COMMON: Final[Headers] = [
    (b"access-control-allow-origin", b"*"),
    (b"x-content-type-options", b"nosniff"),
    (b"cross-origin-resource-policy", b"cross-origin"),
]

log: Final = logging.getLogger("map3d.web")


@dataclass(frozen=True)
class TileUrl:
    """A well-formed tile URL. `version`: the value of `v`, None without one."""

    rendering: str
    view: str
    layer: str
    tile: TileId
    version: int | None


@dataclass(frozen=True)
class TileResponse:
    """The same for every client. `etag` is empty for responses without a tile; only immutable responses have a `source`."""

    status: int
    headers: Headers
    body: bytes
    etag: bytes = b""
    source: OpenStore | None = None


def parse_tile_url(path: str, query: bytes) -> TileUrl | None:
    """Returns None unless the path is `/<rendering>/<view>/<layer>/<z>/<x>/<y>` with plain numbers of a possible tile."""
    parts = path.split("/")
    if len(parts) != 7:
        return None
    _, rendering, view, layer, z, x, y = parts
    tile = parse_tile(z, x, y)
    return None if tile is None else TileUrl(rendering, view, layer, tile, _parse_version(query))


def etag_matches(if_none_match: bytes, etag: bytes) -> bool:
    """Weak comparison, RFC 9110 §13.1.2."""
    if not etag:
        return False
    tags = [tag.strip().removeprefix(b"W/") for tag in if_none_match.split(b",")]
    return b"*" in tags or etag in tags


class TileRoute:
    """Serves the tiles of a workspace. Belongs to one event loop; several processes may serve the same workspace."""

    def __init__(self, workspace: Workspace, cache_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self.stores = OpenStores(workspace)
        self.cache: ByteLru[tuple[str, bytes], TileResponse] = ByteLru(cache_bytes)
        self._readers = ThreadPoolExecutor(READING_THREADS, thread_name_prefix="tiles")

    def matches(self, path: str) -> bool:
        """Whether the path is a tile URL, well-formed or not."""
        return path.startswith(PREFIXES) and path.count("/") == 7

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] not in ("GET", "HEAD"):
            await _send(send, _error(405, "method not allowed; use GET or HEAD", [(b"allow", b"GET, HEAD")]), head=False)
            return
        key = (scope["path"][scope["path"].index("/", 1) :], scope["query_string"])
        response = self.cache.get(key)
        if response is None or not (response.source and response.source.is_current(time.monotonic())):
            response = await self._respond(*key)
            if response.source and b"&" not in key[1]:
                self.cache.put(key, response, len(response.body))
        if response.etag and etag_matches(_header(scope["headers"], b"if-none-match"), response.etag):
            response = TileResponse(304, [pair for pair in response.headers if pair[0] not in (b"content-length", b"content-type")], b"")
        await _send(send, response, head=scope["method"] == "HEAD")

    async def close(self) -> None:
        self._readers.shutdown(cancel_futures=True)
        self.stores.close()

    async def _respond(self, path: str, query: bytes) -> TileResponse:
        url = parse_tile_url(path, query)
        if url is None:
            return _error(404, "not a tile URL; expected /tiles/<rendering>/<view>/<layer>/<z>/<x>/<y> with 0 ≤ x, y < 2^z")
        try:
            return await asyncio.get_running_loop().run_in_executor(self._readers, self._read, url)
        except Exception as error:
            return _error(*status_of(error))

    def _read(self, url: TileUrl) -> TileResponse:
        names: list[str] = []
        for opened in self.stores.stores_of_view(url.rendering, url.view):
            if url.layer in opened.layers:
                return _read_from(opened, url)
            names += opened.layers
        if names:
            return _error(404, f"no layer {url.layer[:64]!r}; the layers are {', '.join(names)}")
        return _error(404, f"no rendering {url.rendering[:64]!r} with view {url.view[:64]!r}")


def _read_from(opened: OpenStore, url: TileUrl) -> TileResponse:
    number, layer = opened.layers[url.layer]
    shape = opened.store.shape
    if url.tile.z > shape.zmax:
        return _error(404, f"no level {url.tile.z}; the deepest level is {shape.zmax}")
    root = block_of(url.tile, shape.zmax)
    before = opened.store.get_block(root)
    data = opened.store.get_tile(number, *url.tile)
    caching = _cache_control(before, opened.store.get_block(root), url.version)
    source = opened if caching is IMMUTABLE else None
    return _empty_response(caching, source) if data is None else _tile_response(data, layer.media_type, caching, source)


def _cache_control(before: StoredBlock | None, after: StoredBlock | None, version: int | None) -> bytes:
    """Immutable only when the URL carries the block's current version; without a block, not stored at all.

    `before` and `after` are the block before and after reading the tile: if it was replaced in between, the bytes may not match the version.
    """
    if after is None:
        return NO_STORE
    return IMMUTABLE if before == after and version == after.version else NO_CACHE


def _tile_response(data: bytes, media_type: str, caching: bytes, source: OpenStore | None) -> TileResponse:
    etag = b'"%s"' % content_hash(data).hex().encode()
    length = str(len(data)).encode()
    headers = [(b"content-type", media_type.encode()), (b"content-length", length), (b"etag", etag), (b"cache-control", caching), *COMMON]
    return TileResponse(200, headers, data, etag, source)


def _empty_response(caching: bytes, source: OpenStore | None) -> TileResponse:
    return TileResponse(204, [(b"cache-control", caching), *COMMON], b"", source=source)


def _error(status: int, text: str, more: Iterable[tuple[bytes, bytes]] = ()) -> TileResponse:
    body = (text + "\n").encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode()), (b"cache-control", NO_STORE)]
    return TileResponse(status, [*headers, *COMMON, *more], body)


async def _send(send: Send, response: TileResponse, *, head: bool) -> None:
    await send({"type": "http.response.start", "status": response.status, "headers": response.headers})
    await send({"type": "http.response.body", "body": b"" if head else response.body})


def _header(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> bytes:
    return b",".join(value for key, value in headers if key == name)


def _parse_version(query: bytes) -> int | None:
    """Returns the value of `v`, None unless it is a plain number and occurs once."""
    values = [pair[2:] for pair in query.split(b"&") if pair.startswith(b"v=")]
    if len(values) != 1 or not (0 < len(values[0]) <= 10 and values[0].isdigit()) or values[0].startswith(b"0"):
        return None
    return int(values[0])
