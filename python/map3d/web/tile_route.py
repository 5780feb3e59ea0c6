"""The tile route (spec/manifest.md, Tile URL): plain ASGI, a bounded cache in memory, no framework per tile."""

import asyncio
import logging
import time
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Final

from map3d.catalogue.workspace import Workspace
from map3d.tiles.naming import block_of, parse_tile
from map3d.tiles.store import StoredBlock, content_hash
from map3d.types import TileId
from map3d.web.byte_lru import ByteLru
from map3d.web.http_errors import status_of
from map3d.web.open_stores import OpenStore, Stores

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]

PREFIXES: Final = ("/tiles/", "/view/")
"""The second is for the viewer's page, which takes tiles from its own folder."""

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
    """A well-formed tile URL. `version`: of its `v`, None without one."""

    rendering: str
    view: str
    layer: str
    tile: TileId
    version: int | None


@dataclass(frozen=True)
class Answer:
    """What is sent for a tile, whoever asks. `etag` is empty where there is nothing to compare; `source` only of what may be kept for ever."""

    status: int
    headers: Headers
    body: bytes
    etag: bytes = b""
    source: OpenStore | None = None


def parse_tile_url(path: str, query: bytes) -> TileUrl | None:
    """None unless the path is `/<rendering>/<view>/<layer>/<z>/<x>/<y>` with plain numbers of a tile that can exist."""
    parts = path.split("/")
    if len(parts) != 7:
        return None
    _, rendering, view, layer, z, x, y = parts
    tile = parse_tile(z, x, y)
    return None if tile is None else TileUrl(rendering, view, layer, tile, _version(query))


def etag_matches(if_none_match: bytes, etag: bytes) -> bool:
    """Weak comparison of RFC 9110 §13.1.2."""
    if not etag:
        return False
    asked = [tag.strip().removeprefix(b"W/") for tag in if_none_match.split(b",")]
    return b"*" in asked or etag in asked


class TileRoute:
    """Serves tiles of the workspace's stores. Belongs to one event loop; any number of processes may serve one workspace."""

    def __init__(self, workspace: Workspace, cache_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self.stores = Stores(workspace)
        self.cache: ByteLru[tuple[str, bytes], Answer] = ByteLru(cache_bytes)
        self._readers = ThreadPoolExecutor(READING_THREADS, thread_name_prefix="tiles")

    def owns(self, path: str) -> bool:
        """Whether a path is meant as a tile's, well-formed or not."""
        return path.startswith(PREFIXES) and path.count("/") == 7

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] not in ("GET", "HEAD"):
            await _send(send, _refusal(405, "only GET and HEAD", [(b"allow", b"GET, HEAD")]), head=False)
            return
        key = (scope["path"][scope["path"].index("/", 1) :], scope["query_string"])
        answer = self.cache.get(key)
        if answer is None or not (answer.source and answer.source.is_current(time.monotonic())):
            answer = await self._answer(*key)
            if answer.source and b"&" not in key[1]:
                self.cache.put(key, answer, len(answer.body))
        if answer.etag and etag_matches(_header(scope["headers"], b"if-none-match"), answer.etag):
            answer = Answer(304, [pair for pair in answer.headers if pair[0] not in (b"content-length", b"content-type")], b"")
        await _send(send, answer, head=scope["method"] == "HEAD")

    async def close(self) -> None:
        self._readers.shutdown(cancel_futures=True)
        self.stores.close()

    async def _answer(self, path: str, query: bytes) -> Answer:
        url = parse_tile_url(path, query)
        if url is None:
            return _refusal(404, "not a tile: /tiles/<rendering>/<view>/<layer>/<z>/<x>/<y> with plain numbers, x and y less than 2^z")
        try:
            return await asyncio.get_running_loop().run_in_executor(self._readers, self._read, url)
        except Exception as error:
            return _refusal(*status_of(error))

    def _read(self, url: TileUrl) -> Answer:
        names: list[str] = []
        for opened in self.stores.of_view(url.rendering, url.view):
            if url.layer in opened.layers:
                return _read_from(opened, url)
            names += opened.layers
        return _refusal(404, f"no such layer; there are {', '.join(names)}" if names else "no such rendering or view")


def _read_from(opened: OpenStore, url: TileUrl) -> Answer:
    """From the store that has the layer."""
    number, layer = opened.layers[url.layer]
    shape = opened.store.shape
    if url.tile.z > shape.zmax:
        return _refusal(404, f"the deepest level is {shape.zmax}")
    root = block_of(url.tile, shape.zmax)
    before = opened.store.get_block(root)
    data = opened.store.get_tile(number, *url.tile)
    caching = _caching(before, opened.store.get_block(root), url.version)
    source = opened if caching is IMMUTABLE else None
    return _empty(caching, source) if data is None else _tile(data, layer.media_type, caching, source)


def _caching(before: StoredBlock | None, after: StoredBlock | None, version: int | None) -> bytes:
    """Only what was asked for by its present version may be kept for ever; of a block that is not there yet, nothing.

    A block put in place between the two looks may have given other bytes than its version says.
    """
    if after is None:
        return NO_STORE
    return IMMUTABLE if before == after and version == after.version else NO_CACHE


def _tile(data: bytes, media_type: str, caching: bytes, source: OpenStore | None) -> Answer:
    etag = b'"%s"' % content_hash(data).hex().encode()
    length = str(len(data)).encode()
    headers = [(b"content-type", media_type.encode()), (b"content-length", length), (b"etag", etag), (b"cache-control", caching), *COMMON]
    return Answer(200, headers, data, etag, source)


def _empty(caching: bytes, source: OpenStore | None) -> Answer:
    return Answer(204, [(b"cache-control", caching), *COMMON], b"", source=source)


def _refusal(status: int, text: str, more: Iterable[tuple[bytes, bytes]] = ()) -> Answer:
    body = (text + "\n").encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode()), (b"cache-control", NO_STORE)]
    return Answer(status, [*headers, *COMMON, *more], body)


async def _send(send: Send, answer: Answer, *, head: bool) -> None:
    await send({"type": "http.response.start", "status": answer.status, "headers": answer.headers})
    await send({"type": "http.response.body", "body": b"" if head else answer.body})


def _header(headers: Iterable[tuple[bytes, bytes]], name: bytes) -> bytes:
    return b",".join(value for key, value in headers if key == name)


def _version(query: bytes) -> int | None:
    """The number of `v` if it is plain and given once."""
    values = [pair[2:] for pair in query.split(b"&") if pair.startswith(b"v=")]
    if len(values) != 1 or not (0 < len(values[0]) <= 10 and values[0].isdigit()) or values[0].startswith(b"0"):
        return None
    return int(values[0])
