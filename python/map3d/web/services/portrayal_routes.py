"""The routes of the 3D Portrayal Service: `/3dps` and `/3dps/strict`, GET with key-value pairs and POST with XML.

Plain ASGI like the tile route: views that take long wait here without a thread. Reading is public, hence the header for pages of any origin.
"""

import asyncio
from typing import Final

from starlette.exceptions import HTTPException
from starlette.responses import Response

from map3d.catalogue.workspace import Workspace
from map3d.cores import usable_cores
from map3d.portrayal.answers import Answer
from map3d.portrayal.service import PortrayalService, ServiceRequest
from map3d.portrayal.tracer_pool import SUBPROCESSES, TracerPool
from map3d.portrayal.xml_requests import MAX_BODY_BYTES
from map3d.web.http.asgi import Receive, Scope, Send
from map3d.web.http.bodies import Bodies
from map3d.web.http.clients import client_address
from map3d.web.http.conditions import etag_matches, header, without_body
from map3d.web.http.headers import ANY_ORIGIN
from map3d.web.http.http_errors import not_allowed, plain_error
from map3d.web.http.public_url import root_url
from map3d.web.http.settings import ServerSettings
from map3d.web.http.shared_catalogue import WAIT_S

PATH: Final = "/3dps"
STRICT_PATH: Final = "/3dps/strict"
PATHS: Final = (PATH, PATH + "/", STRICT_PATH)
METHODS: Final = ("GET", "HEAD", "POST", "OPTIONS")
COMMON: Final = {
    **ANY_ORIGIN,
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'",
    "Access-Control-Expose-Headers": "Retry-After, ETag",
}
PREFLIGHT: Final = {
    "Access-Control-Allow-Methods": ", ".join(METHODS),
    "Access-Control-Allow-Headers": "Content-Type",
    "Access-Control-Max-Age": "86400",
}


def make_pool() -> TracerPool:
    """Returns the pool of a server process."""
    return TracerPool(subprocesses=min(SUBPROCESSES, usable_cores()))


class PortrayalRoute:
    """Belongs to one event loop. Opens the service with the first request."""

    def __init__(self, workspace: Workspace, settings: ServerSettings, bodies: Bodies) -> None:
        self._workspace, self._settings, self._bodies = workspace, settings, bodies
        self._service: PortrayalService | None = None
        self._opening = asyncio.Lock()

    def answers(self, scope: Scope) -> bool:
        return scope["path"] in PATHS

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            response = await self._respond(scope, receive)
        except HTTPException as error:
            response = plain_error(error, COMMON)
        await response(scope, receive, send)

    async def close(self) -> None:
        if self._service is not None:
            await asyncio.get_running_loop().run_in_executor(None, self._service.close)
            self._service = None

    async def _respond(self, scope: Scope, receive: Receive) -> Response:
        """Raises HTTPException for another method and for a body that does not arrive."""
        if scope["method"] == "OPTIONS":
            return Response(status_code=204, headers={**COMMON, **PREFLIGHT})
        if scope["method"] not in METHODS:
            raise not_allowed(*METHODS)
        if scope["method"] != "POST":
            return await self._ask(scope, None)
        with self._bodies.hold(client_address(scope, self._settings.trusted_proxies)) as held:
            return await self._ask(scope, await held.read(scope, receive, MAX_BODY_BYTES))

    async def _ask(self, scope: Scope, body: bytes | None) -> Response:
        service = await self._open()
        endpoint = root_url(self._settings, scope) + scope["path"].rstrip("/")
        request = ServiceRequest(scope["query_string"], body, endpoint, scope["path"] == STRICT_PATH)
        return _response(await asyncio.wrap_future(service.submit(request)), scope)

    async def _open(self) -> PortrayalService:
        async with self._opening:
            if self._service is None:
                loop = asyncio.get_running_loop()
                self._service = await loop.run_in_executor(None, lambda: PortrayalService(self._workspace, pool=make_pool(), wait_s=WAIT_S))
            return self._service


def _response(answer: Answer, scope: Scope) -> Response:
    """Returns 304 if the client has the same answer."""
    response = Response(answer.body, answer.status, {**COMMON, **answer.headers}, answer.media_type or None)
    if answer.status == 200 and etag_matches(header(scope["headers"], b"if-none-match"), answer.headers.get("ETag", "").encode()):
        response.status_code, response.body, response.raw_headers = 304, b"", without_body(response.raw_headers)
    return response
