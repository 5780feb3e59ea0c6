"""The routes of the 3D Portrayal Service: `/3dps` and `/3dps/strict`, GET with key-value pairs and POST with XML.

Plain ASGI like the tile route: views that take long wait here without a thread of Flask. Reading is public, hence the header for pages of any origin.
"""

import asyncio
from typing import Final

from map3d.catalogue.workspace import Workspace
from map3d.cores import usable_cores
from map3d.portrayal.answers import Answer
from map3d.portrayal.service import PortrayalService, ServiceRequest
from map3d.portrayal.tracer_pool import SUBPROCESSES, TracerPool
from map3d.portrayal.xml_requests import MAX_BODY_BYTES
from map3d.web.http.settings import ServerSettings
from map3d.web.tiles.tile_route import Receive, Scope, Send, etag_matches

PATH: Final = "/3dps"
STRICT_PATH: Final = "/3dps/strict"
PATHS: Final = (PATH, PATH + "/", STRICT_PATH)
METHODS: Final = "GET, HEAD, POST, OPTIONS"
BODY_S: Final = 30.0
"""Time in which a body has to arrive."""
COMMON: Final = {
    "Access-Control-Allow-Origin": "*",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "cross-origin",
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'",
    "Access-Control-Expose-Headers": "Retry-After, ETag",
}
PREFLIGHT: Final = {"Access-Control-Allow-Methods": METHODS, "Access-Control-Allow-Headers": "Content-Type", "Access-Control-Max-Age": "86400"}


def make_pool() -> TracerPool:
    """Returns the pool of a server process."""
    return TracerPool(subprocesses=min(SUBPROCESSES, usable_cores()))


class PortrayalRoute:
    """Belongs to one event loop. Opens the service with the first request."""

    def __init__(self, workspace: Workspace, settings: ServerSettings) -> None:
        self._workspace, self._settings = workspace, settings
        self._service: PortrayalService | None = None
        self._opening = asyncio.Lock()

    def matches(self, path: str) -> bool:
        return path in PATHS

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        method = scope["method"]
        if method == "OPTIONS":
            await _send(send, Answer(204, "", b"", PREFLIGHT))
        elif method in ("GET", "HEAD", "POST"):
            answer = await self._answer(scope, receive)
            await _send(send, _revalidated(scope, answer), head=method == "HEAD")
        else:
            await _send(send, Answer(405, "text/plain", f"method not allowed; use {METHODS}\n".encode(), {"Allow": METHODS}))

    async def close(self) -> None:
        if self._service is not None:
            await asyncio.get_running_loop().run_in_executor(None, self._service.close)
            self._service = None

    async def _answer(self, scope: Scope, receive: Receive) -> Answer:
        body = None
        if scope["method"] == "POST":
            try:
                body = await asyncio.wait_for(_read_body(receive), BODY_S)
            except TimeoutError:
                return Answer(408, "text/plain", b"the body did not arrive in time\n", {"Connection": "close"})
        service = await self._open()
        request = ServiceRequest(scope["query_string"], body, self._endpoint(scope), scope["path"] == STRICT_PATH)
        return await asyncio.wrap_future(service.submit(request))

    async def _open(self) -> PortrayalService:
        async with self._opening:
            if self._service is None:
                loop = asyncio.get_running_loop()
                self._service = await loop.run_in_executor(None, lambda: PortrayalService(self._workspace, pool=make_pool()))
            return self._service

    def _endpoint(self, scope: Scope) -> str:
        """Returns the absolute URL of the service: below the public URL, else as the client addressed it."""
        path: str = scope["path"].rstrip("/")
        if self._settings.public_url:
            return self._settings.public_url + path
        host = next((value.decode("latin-1") for name, value in scope["headers"] if name == b"host"), "localhost")
        return f"{scope.get('scheme', 'http')}://{host}{path}"


async def _read_body(receive: Receive) -> bytes:
    """Returns the body, or its beginning where it is longer than allowed, which the parser refuses."""
    body = bytearray()
    while True:
        event = await receive()
        body += event.get("body", b"")
        if event["type"] != "http.request" or not event.get("more_body") or len(body) > MAX_BODY_BYTES:
            return bytes(body[: MAX_BODY_BYTES + 1])


def _revalidated(scope: Scope, answer: Answer) -> Answer:
    """Returns 304 if the client has the same answer."""
    tag = answer.headers.get("ETag", "").encode()
    known = b",".join(value for name, value in scope["headers"] if name == b"if-none-match")
    return Answer(304, "", b"", answer.headers) if answer.status == 200 and etag_matches(known, tag) else answer


async def _send(send: Send, answer: Answer, *, head: bool = False) -> None:
    headers = {**COMMON, **answer.headers}
    if answer.media_type:
        text = answer.media_type.startswith("text/")
        headers |= {"Content-Type": answer.media_type + ("; charset=utf-8" if text else ""), "Content-Length": str(len(answer.body))}
    listed = [(name.lower().encode(), value.encode("latin-1")) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": answer.status, "headers": listed})
    await send({"type": "http.response.body", "body": b"" if head else answer.body})
