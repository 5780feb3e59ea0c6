"""Manifests from memory: plain ASGI, because every visitor fetches one first. A view function answers what is not a file of the workspace."""

import asyncio
import os
import time
from collections import OrderedDict
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Final

from map3d.catalogue import Workspace
from map3d.errors import Map3dError
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.track_stores import rendering_record, tiles_url
from map3d.web.http.accepting import accepts_gzip
from map3d.web.http.asgi import EMPTY, Application, Headers, Messages, Receive, Scope, Send
from map3d.web.http.conditions import etag_matches, header, without_body
from map3d.web.http.headers import NO_CACHE, TILES, page_headers
from map3d.web.http.open_stores import RECHECK_S
from map3d.web.http.responses import MIN_BYTES, gzip_bytes
from map3d.web.tiles.tile_route import KeptResponse

MOST_MANIFESTS: Final = 64
MOST_BYTES: Final = 8 << 20
"""Larger manifests are not kept."""

_COMMON: Final = [*page_headers("/view/"), (b"cache-control", NO_CACHE), (b"vary", b"Accept-Encoding")]

FileState = tuple[int, int, int]
"""(inode, time of change, size)."""


@dataclass
class _Manifest:
    path: str
    state: FileState
    read_s: float
    plain: KeptResponse
    packed: KeptResponse | None

    def is_current(self) -> bool:
        return _state(self.path) == self.state


Reading = asyncio.Future[_Manifest | None]


class ManifestRoute:
    """Belongs to one event loop, except `find_cached`."""

    def __init__(self, workspace: Workspace, otherwise: Application) -> None:
        """`otherwise` answers requests for a manifest that is not a file of the workspace, or too large."""
        self._workspace, self._otherwise = workspace, otherwise
        self._known: OrderedDict[str, _Manifest] = OrderedDict()
        self._readings: dict[str, Reading] = {}

    def answers(self, scope: Scope) -> bool:
        """Whether the path is that of a manifest, and the method one that reads it."""
        path = scope["path"]
        return path.endswith(f"/{FILE_NAME}") and path.startswith(TILES) and path.count("/") == 3 and scope["method"] in ("GET", "HEAD")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        name = scope["path"].split("/")[2]
        found = self._find_known(name) or await self._read_shared(name)
        if found is None:
            await self._otherwise(scope, receive, send)
            return
        for message in _answer(found, scope):
            await send(message)

    def find_cached(self, scope: Scope) -> Messages | None:
        """Returns the answer to a request for a manifest that is in memory and was lately compared with the catalogue; None for all other requests.
        Any thread may call it."""
        if not self.answers(scope):
            return None
        found = self._find_known(scope["path"].split("/")[2])
        return None if found is None else _answer(found, scope)

    def _find_known(self, name: str) -> _Manifest | None:
        """Returns a manifest that was lately compared with the catalogue and has not changed since."""
        found = self._known.get(name)  # a name in memory is one of a rendering, so it is safe in a path
        return found if found is not None and time.monotonic() - found.read_s <= RECHECK_S and found.is_current() else None

    async def _read_shared(self, name: str) -> _Manifest | None:
        """Waits for the reading that is under way, and reads again if the file has changed since that began."""
        found = await asyncio.shield(self._reading(name))
        if found is not None and not found.is_current():
            found = await asyncio.shield(self._reading(name))
        return found

    def _reading(self, name: str) -> Reading:
        """Returns the reading of a manifest, one for all requests that wait for it."""
        reading = self._readings.get(name)
        if reading is None:
            reading = self._readings[name] = asyncio.get_running_loop().run_in_executor(None, self._read, name, self._known.get(name))
            reading.add_done_callback(lambda done: self._end_reading(name, done))
        return reading

    def _end_reading(self, name: str, reading: Reading) -> None:
        del self._readings[name]
        self._keep(name, None if reading.cancelled() or reading.exception() is not None else reading.result())

    def _keep(self, name: str, found: _Manifest | None) -> None:
        self._known.pop(name, None)
        if found is not None:
            self._known[name] = found
            while len(self._known) > MOST_MANIFESTS:
                self._known.popitem(last=False)

    def _read(self, name: str, known: _Manifest | None) -> _Manifest | None:
        """Looks at the catalogue, too: a removed rendering has no manifest, and the tiles of others are elsewhere, with their manifests.
        Does not read a file again that has not changed since it was `known`."""
        try:
            if tiles_url(rendering_record(self._workspace, name)) is not None:
                return None
            path = self._workspace.manifest_path(name)
            state = _state(str(path))
            if known is not None and state == known.state:
                return replace(known, read_s=time.monotonic())
            data = path.read_bytes()
        except (Map3dError, OSError):
            return None
        if state is None or state != _state(str(path)) or len(data) > MOST_BYTES:
            return None
        headers = [*_COMMON, (b"etag", b'W/"%s"' % sha256(data).hexdigest()[:32].encode())]
        packed = None if len(data) < MIN_BYTES else _kept([*headers, (b"content-encoding", b"gzip")], gzip_bytes(data))
        return _Manifest(str(path), state, time.monotonic(), _kept(headers, data), packed)


def _kept(headers: Headers, body: bytes) -> KeptResponse:
    length = (b"content-length", str(len(body)).encode())
    return KeptResponse(200, [*headers, (b"content-type", b"application/json"), length], body, header(headers, b"etag"))


def _answer(found: _Manifest, scope: Scope) -> Messages:
    if_none_match = accepted = b""
    for name, value in scope["headers"]:
        if name == b"accept-encoding":
            accepted = value
        elif name == b"if-none-match":
            if_none_match = value
    if if_none_match and etag_matches(if_none_match, found.plain.etag):
        return KeptResponse(304, without_body(found.plain.headers), b"").messages
    start, body = ((found.packed if accepts_gzip(accepted.decode("latin-1")) else None) or found.plain).messages
    return (start, body if scope["method"] == "GET" else EMPTY)


def _state(path: str) -> FileState | None:
    try:
        stat = os.stat(path)
    except OSError:
        return None
    return stat.st_ino, stat.st_mtime_ns, stat.st_size
