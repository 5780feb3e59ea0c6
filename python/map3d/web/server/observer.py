"""Measures and logs requests."""

import re
import secrets
import time
from collections.abc import Iterable, Sequence
from typing import Any, Final

from map3d.web.http.asgi import Application, Receive, Scope, Send
from map3d.web.http.clients import Network, client_address
from map3d.web.server.logs import ACCESS
from map3d.web.server.metrics import ROUTES, Metrics

CLIENT_CLOSED: Final = 499
"""Status in logs and metrics of a request without an answer."""
REQUEST_ID: Final = b"x-request-id"
_ID: Final = re.compile(r"[A-Za-z0-9._-]{1,64}", re.ASCII)
_TILE, _UPLOAD, _PAGE = range(len(ROUTES))


class Observer:
    """Counts each request and, with `access_log`, logs it under an id: that of the header X-Request-ID, or a new one, which the answer has, too."""

    def __init__(self, metrics: Metrics | None, access_log: bool, proxies: Sequence[Network]) -> None:
        """`proxies`: those that name the addresses of clients."""
        self.metrics, self.access_log, self.proxies = metrics, access_log, proxies

    async def __call__(self, answer: Application, scope: Scope, receive: Receive, send: Send) -> None:
        start, seen = time.perf_counter(), [CLIENT_CLOSED, 0]
        request_id = _request_id(scope["headers"]) if self.access_log else ""

        async def observed_send(message: Any) -> None:
            if message["type"] == "http.response.start":
                seen[0] = message["status"]
                if request_id:
                    message = {**message, "headers": [*message["headers"], (REQUEST_ID, request_id.encode())]}
            else:
                seen[1] += len(message.get("body", b""))
            await send(message)

        if self.metrics is not None:
            self.metrics.begin()
        try:
            await answer(scope, receive, observed_send)
        finally:
            seconds = time.perf_counter() - start
            if self.metrics is not None:
                self.metrics.end(_route_of(scope["path"]), seen[0], seconds)
            if self.access_log:
                _log(scope, self.proxies, request_id, seen[0], seen[1], seconds)

    def count_early(self, scope: Scope, status: int, seconds: float) -> None:
        """Counts a request that was answered at once. Any thread may call it."""
        if self.metrics is not None:
            self.metrics.begin()
            self.metrics.end(_route_of(scope["path"]), status, seconds)


def _log(scope: Scope, proxies: Sequence[Network], request_id: str, status: int, size: int, seconds: float) -> None:
    """The query is left out: it may have what people search for, and tokens."""
    fields = {
        "request_id": request_id,
        "client": client_address(scope, proxies),
        "method": scope["method"],
        "path": _printable(scope["path"]),
        "status": status,
    }
    ACCESS.info("request", extra={"fields": {**fields, "bytes": size, "ms": round(seconds * 1000, 3)}})


def _printable(path: str) -> str:
    """Returns the path in one line, cut."""
    return path[:500].encode("unicode_escape").decode("ascii")


def _request_id(headers: Iterable[tuple[bytes, bytes]]) -> str:
    given = next((value.decode("latin-1") for name, value in headers if name == REQUEST_ID), "")
    return given if _ID.fullmatch(given) else secrets.token_hex(8)


def _route_of(path: str) -> int:
    if path.startswith(("/tiles/", "/view/")) and path.count("/") == 7:
        return _TILE
    return _UPLOAD if path.startswith("/uploads") else _PAGE
