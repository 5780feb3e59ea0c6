"""The tile route (spec/manifest.md, Tile URL): plain ASGI with a bounded memory cache, because a framework costs too much per tile."""

import asyncio
import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeVar

from starlette.exceptions import HTTPException

from map3d.catalogue import Job
from map3d.errors import Unavailable
from map3d.jobs.on_demand.block_requests import BUSY_RETRY_S
from map3d.jobs.on_demand.on_demand import OnDemand
from map3d.tiles.decode_tile import as_layer
from map3d.tiles.naming import block_of, parse_tile
from map3d.tiles.tile_store import StoredBlock, content_hash
from map3d.types import TileId
from map3d.web.http.asgi import EMPTY, Headers, Messages, Receive, Scope, Send
from map3d.web.http.byte_lru import ByteLru
from map3d.web.http.conditions import CONDITIONS, etag_matches, find_range, header, range_headers, without_body
from map3d.web.http.headers import ANY_ORIGIN, IMMUTABLE, NO_CACHE, NO_STORE, TILES, raw
from map3d.web.http.http_errors import not_allowed, plain_error
from map3d.web.http.open_stores import FoundLayer, OpenStore, OpenStores
from map3d.web.http.settings import DEFAULT_CACHE_BYTES
from map3d.web.http.shared_catalogue import SharedCatalogue

Given = TypeVar("Given")
Found = TypeVar("Found")

READING_THREADS: Final = 4
WAIT_S: Final = 20.0
"""How long a request waits for a block that is rendered on demand."""
COMMON: Final = raw(ANY_ORIGIN)
ACCEPT_RANGES: Final = (b"accept-ranges", b"bytes")

log: Final = logging.getLogger("map3d.web")


@dataclass(frozen=True)
class TileUrl:
    """A well-formed tile URL. `version`: the value of `v`, or None."""

    rendering: str
    view: str
    layer: str
    tile: TileId
    version: int | None


@dataclass(frozen=True)
class KeptResponse:
    """A response in memory, the same for every client. `etag` is empty for responses without a tile; only immutable ones have a `source`."""

    status: int
    headers: Headers
    body: bytes
    etag: bytes = b""
    source: OpenStore | None = None

    @cached_property
    def messages(self) -> Messages:
        """The response as ASGI messages."""
        return (
            {"type": "http.response.start", "status": self.status, "headers": self.headers},
            {"type": "http.response.body", "body": self.body},
        )


def parse_tile_url(path: str, query: bytes) -> TileUrl | None:
    """Returns None unless the path is `/<rendering>/<view>/<layer>/<z>/<x>/<y>` with plain numbers of a possible tile."""
    parts = path.split("/")
    if len(parts) != 7:
        return None
    _, rendering, view, layer, z, x, y = parts
    tile = parse_tile(z, x, y)
    return None if tile is None else TileUrl(rendering, view, layer, tile, _parse_version(query))


class TileRoute:
    """Serves the tiles of a workspace. Belongs to one event loop, except `find_cached`; several processes may serve the same workspace."""

    def __init__(self, catalogue: SharedCatalogue, cache_bytes: int = DEFAULT_CACHE_BYTES, on_demand: OnDemand | None = None) -> None:
        """`on_demand` renders the blocks that are missing or stale."""
        self.stores = OpenStores(catalogue) if on_demand is None else OpenStores(catalogue, on_demand.epoch)
        self.on_demand = on_demand
        self.cache_hits = 0
        self.cache: ByteLru[tuple[str, bytes], KeptResponse] = ByteLru(cache_bytes)
        self._cache_lock = threading.Lock()
        self._readers = ThreadPoolExecutor(READING_THREADS, thread_name_prefix="tiles")

    def answers(self, scope: Scope) -> bool:
        """Whether the path is a tile URL, well-formed or not."""
        path: str = scope["path"]
        return path.startswith(TILES) and path.count("/") == 7

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] not in ("GET", "HEAD"):
            response = _error_response(not_allowed("GET", "HEAD"))
        else:
            response = for_client(await self.find(_cache_key(scope), receive), scope)
        for message in response.messages:
            await send(message)

    async def find(self, key: tuple[str, bytes], receive: Receive) -> KeptResponse:
        """`key`: the path of a tile without its first part, and the query."""
        response = self._get_cached(key, OpenStore.is_current)
        if response is None:
            response = await self._respond(*key, receive)
            if response.source and b"&" not in key[1]:
                with self._cache_lock:
                    self.cache.put(key, response, len(response.body))
        return response

    def find_cached(self, scope: Scope) -> Messages | None:
        """Returns the answer to a request for a tile that is in memory and was lately compared with its store, without I/O; None for all other
        requests. Any thread may call it. All requests of the process pass here first, so it is short."""
        method, path = scope["method"], scope["path"]
        if not path.startswith(TILES) or (method != "GET" and method != "HEAD"):
            return None
        response = self._get_cached((path[path.index("/", 1) :], scope["query_string"]), OpenStore.is_fresh)
        if response is None:
            return None
        for name, _ in scope["headers"]:
            if name in CONDITIONS:
                response = for_client(response, scope)
                break
        return response.messages if method == "GET" else (response.messages[0], EMPTY)

    def _get_cached(self, key: tuple[str, bytes], is_valid: Callable[[OpenStore, float], bool]) -> KeptResponse | None:
        with self._cache_lock:
            response = self.cache.get(key)
            if response is None or response.source is None or not is_valid(response.source, time.monotonic()):
                return None
            self.cache_hits += 1
            return response

    async def close(self) -> None:
        self._readers.shutdown(cancel_futures=True)
        self.stores.close()

    async def _respond(self, path: str, query: bytes, receive: Receive) -> KeptResponse:
        url = parse_tile_url(path, query)
        try:
            if url is None:
                raise HTTPException(404, "not a tile URL; expected /tiles/<rendering>/<view>/<layer>/<z>/<x>/<y> with 0 ≤ x, y < 2^z")
            found = await self._run(self._read, url)
            if isinstance(found, Job):
                await self._wait_for(found, receive)
                found = await self._run(self._read, url)
            if isinstance(found, Job):
                raise Unavailable(f"block {found.block} was removed again; try again in 1 s", 1)
            return found
        except Exception as error:
            return _error_response(error)

    async def _run(self, function: Callable[[Given], Found], given: Given) -> Found:
        return await asyncio.get_running_loop().run_in_executor(self._readers, function, given)

    async def _wait_for(self, job: Job, receive: Receive) -> None:
        """Waits until the block is rendered. Raises Unavailable when that takes long; the block is rendered nevertheless, unless the client has gone
        away and no other waits for it."""
        assert self.on_demand is not None, "only a server that renders on demand waits for jobs"
        wanted = await self._run(self.on_demand.ask, job)
        ended = asyncio.wrap_future(wanted.ended)
        ended.add_done_callback(lambda future: future.cancelled() or future.exception())
        gone = asyncio.ensure_future(_disconnected(receive))
        done: set[asyncio.Future[None]] = set()
        try:
            done, _ = await asyncio.wait({ended, gone}, timeout=WAIT_S, return_when=asyncio.FIRST_COMPLETED)
        finally:
            gone.cancel()
            self.on_demand.requests.leave(wanted, keep=gone not in done)
        if ended not in done:
            raise Unavailable(f"block {job.block} of track {job.track} is being rendered; try again in {BUSY_RETRY_S} s", BUSY_RETRY_S)
        ended.result()

    def _read(self, url: TileUrl) -> KeptResponse | Job:
        """Returns the stored tile, or the open job of a block that is not stored. A stored block whose job is open is rendered meanwhile."""
        found = None if self.on_demand is None else self.on_demand.find_track(url.rendering, url.view, url.layer)
        block = block_of(url.tile, found[0].zmax) if found is not None and url.tile.z <= found[0].zmax else None
        if self.on_demand is None or found is None or block is None:
            return self._read_stored(url)
        record, track = found
        job = self.on_demand.open_job(record.name, track.id, block)
        self.on_demand.touch(record.name, track.id, block)
        if job is None:
            return self._read_stored(url)
        stale = self._read_stale(url)
        if stale is not None:
            with suppress(Unavailable):
                self.on_demand.ask(job, keep=True)
        return stale or job

    def _read_stale(self, url: TileUrl) -> KeptResponse | None:
        """Returns a tile that clients revalidate each time; None if its block is not stored."""
        found = self.stores.find_layer(url.rendering, url.view, url.layer)
        response = None if found is None else _read_from(found, url, is_stale=True)
        return None if response is None or (b"cache-control", NO_STORE) in response.headers else response

    def _read_stored(self, url: TileUrl) -> KeptResponse:
        """Raises HTTPException for what no store has."""
        found = self.stores.find_layer(url.rendering, url.view, url.layer)
        if found is not None:
            return _read_from(found, url)
        names = self.stores.layer_names(url.rendering, url.view)
        if names:
            raise HTTPException(404, f"no layer {url.layer[:64]!r}; the layers are {', '.join(names)}")
        raise HTTPException(404, f"no rendering {url.rendering[:64]!r} with view {url.view[:64]!r}")


def _read_from(found: FoundLayer, url: TileUrl, *, is_stale: bool = False) -> KeptResponse:
    opened, shape = found.opened, found.opened.store.shape
    if url.tile.z > shape.zmax:
        raise HTTPException(404, f"no level {url.tile.z}; the deepest level is {shape.zmax}")
    root = block_of(url.tile, shape.zmax)
    before = opened.store.get_block(root)
    data = opened.store.get_tile(found.number, *url.tile)
    caching = _cache_control(before, opened.store.get_block(root), None if is_stale else url.version)
    source = opened if caching is IMMUTABLE else None
    if data is None:
        return _empty_response(caching, source)
    where = f"{opened.store.url}: tile {found.stored.name}/{url.tile.z}/{url.tile.x}/{url.tile.y}"
    return _tile_response(as_layer(found.asked, found.stored, data, shape.tile_px, where), found.asked.media_type, caching, source)


def _cache_control(before: StoredBlock | None, after: StoredBlock | None, version: int | None) -> bytes:
    """Immutable only when the URL carries the block's current version; without a block, not stored at all.

    `before` and `after` are the block before and after reading the tile: if it was replaced in between, the bytes may not match the version.
    """
    if after is None:
        return NO_STORE
    return IMMUTABLE if before == after and version == after.version else NO_CACHE


def _cache_key(scope: Scope) -> tuple[str, bytes]:
    """Returns the path without its prefix, and the query."""
    return scope["path"][scope["path"].index("/", 1) :], scope["query_string"]


def for_client(response: KeptResponse, scope: Scope) -> KeptResponse:
    """Answers requests with If-None-Match, and those with one range."""
    headers = scope["headers"]
    if not response.etag or not any(name in CONDITIONS for name, _ in headers):
        return response
    if etag_matches(header(headers, b"if-none-match"), response.etag):
        return KeptResponse(304, without_body(response.headers), b"")
    size = len(response.body)
    try:
        found = find_range(headers, response.etag, size) if scope["method"] == "GET" else None
    except HTTPException as error:
        return _error_response(error)
    return response if found is None else KeptResponse(206, range_headers(response.headers, *found, size), response.body[slice(*found)])


def _tile_response(data: bytes, media_type: str, caching: bytes, source: OpenStore | None) -> KeptResponse:
    etag = b'"%s"' % content_hash(data).hex().encode()
    length = str(len(data)).encode()
    headers = [
        (b"content-type", media_type.encode()),
        (b"content-length", length),
        (b"etag", etag),
        (b"cache-control", caching),
        ACCEPT_RANGES,
        *COMMON,
    ]
    return KeptResponse(200, headers, data, etag, source)


def _empty_response(caching: bytes, source: OpenStore | None) -> KeptResponse:
    return KeptResponse(204, [(b"cache-control", caching), *COMMON], b"", source=source)


def _error_response(error: Exception) -> KeptResponse:
    response = plain_error(error, ANY_ORIGIN)
    return KeptResponse(response.status_code, response.raw_headers, bytes(response.body))


async def _disconnected(receive: Receive) -> None:
    """Returns when the client has gone away."""
    while (await receive())["type"] != "http.disconnect":
        pass


def _parse_version(query: bytes) -> int | None:
    """Returns the value of `v`, None unless it is a plain number and occurs once."""
    values = [pair[2:] for pair in query.split(b"&") if pair.startswith(b"v=")]
    if len(values) != 1 or not (0 < len(values[0]) <= 10 and values[0].isdigit()) or values[0].startswith(b"0"):
        return None
    return int(values[0])
