"""Manifests from memory: plain ASGI, because every visitor fetches one first, and a framework costs too much. Flask answers what is not in memory."""

import asyncio
import os
import time
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from typing import Final

from map3d.catalogue import Workspace
from map3d.errors import Map3dError
from map3d.publish.page_head import VIEWER_POLICY
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.track_stores import rendering_record, tiles_url
from map3d.web.http.compression import MIN_BYTES, gzip_bytes
from map3d.web.http.open_stores import RECHECK_S
from map3d.web.tiles.tile_route import PREFIXES, Headers, Messages, Receive, Scope, Send, etag_matches

MOST_MANIFESTS: Final = 64
MOST_BYTES: Final = 8 << 20
"""Larger manifests are not kept."""

FileState = tuple[int, int, int]
"""(inode, time of change, size)."""


@dataclass
class _Manifest:
    path: str
    state: FileState
    read_s: float
    etag: bytes
    plain: bytes
    packed: bytes | None

    @cached_property
    def whole(self) -> Messages:
        return _messages(self.etag, self.plain)

    @cached_property
    def whole_packed(self) -> Messages | None:
        return None if self.packed is None else _messages(self.etag, self.packed, ((b"content-encoding", b"gzip"),))

    def is_current(self) -> bool:
        return _state(self.path) == self.state


Reading = asyncio.Future[_Manifest | None]


class ManifestRoute:
    """Belongs to one event loop, except `find_cached`."""

    def __init__(self, workspace: Workspace) -> None:
        self._workspace = workspace
        self._known: OrderedDict[str, _Manifest] = OrderedDict()
        self._readings: dict[str, Reading] = {}

    def matches(self, path: str, method: str) -> bool:
        """Whether the path is that of a manifest, and the method one that reads it."""
        return path.endswith(f"/{FILE_NAME}") and path.startswith(PREFIXES) and path.count("/") == 3 and method in ("GET", "HEAD")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> bool:
        """Answers the request; returns False, without an answer, for a manifest that is not a file of the workspace."""
        name = scope["path"].split("/")[2]
        found = self._find_known(name) or await self._read_shared(name)
        if found is None:
            return False
        for message in _answer(found, scope):
            await send(message)
        return True

    def find_cached(self, scope: Scope) -> Messages | None:
        """Returns the answer to a request for a manifest that is in memory and was lately compared with the catalogue; None for all other requests.
        Any thread may call it."""
        if not self.matches(scope["path"], scope["method"]):
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
        etag = b'W/"%s"' % sha256(data).hexdigest()[:32].encode()
        return _Manifest(str(path), state, time.monotonic(), etag, data, gzip_bytes(data) if len(data) >= MIN_BYTES else None)


def _answer(found: _Manifest, scope: Scope) -> Messages:
    if_none_match = accepted = b""
    for name, value in scope["headers"]:
        if name == b"accept-encoding":
            accepted = value
        elif name == b"if-none-match":
            if_none_match = value
    if if_none_match and etag_matches(if_none_match, found.etag.removeprefix(b"W/")):
        return _messages(found.etag, None)
    start, body = (found.whole_packed if _accepts_gzip(accepted) else None) or found.whole
    return (start, body if scope["method"] == "GET" else {"type": "http.response.body", "body": b""})


def _messages(etag: bytes, body: bytes | None, more: Sequence[tuple[bytes, bytes]] = ()) -> Messages:
    """Returns the answer with a body, or that the client has it already."""
    headers: Headers = [
        (b"etag", etag),
        (b"cache-control", b"no-cache"),
        (b"vary", b"Accept-Encoding"),
        (b"access-control-allow-origin", b"*"),
        (b"x-content-type-options", b"nosniff"),
        (b"content-security-policy", VIEWER_POLICY.encode()),
        (b"referrer-policy", b"same-origin"),
        *more,
    ]
    if body is not None:
        headers += [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
    return (
        {"type": "http.response.start", "status": 304 if body is None else 200, "headers": headers},
        {"type": "http.response.body", "body": body or b""},
    )


def _accepts_gzip(accepted: bytes) -> bool:
    """Takes any weight of gzip below 1 for a refusal, which is never wrong."""
    return accepted != b"" and any(part.strip().lower() in (b"gzip", b"*", b"gzip;q=1") for part in accepted.replace(b" ", b"").split(b","))


def _state(path: str) -> FileState | None:
    try:
        stat = os.stat(path)
    except OSError:
        return None
    return stat.st_ino, stat.st_mtime_ns, stat.st_size
