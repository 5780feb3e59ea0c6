"""/healthz: the process answers. /readyz: the server can do its work, part by part.

Both have threads of their own, so that a database or a disk that hangs delays neither; /healthz needs none.
"""

import asyncio
import json
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Final

from starlette.responses import Response

from map3d.web.http.asgi import Receive, Scope, Send
from map3d.web.http.headers import page_headers
from map3d.web.http.health import Check
from map3d.web.http.http_errors import not_allowed, plain_error
from map3d.web.http.responses import uncached

ALIVE: Final = "/healthz"
READY: Final = "/readyz"
READY_S: Final = 1.5
"""Time that the parts have to answer."""


class HealthRoute:
    """Belongs to one event loop."""

    def __init__(self, checks: Mapping[str, Check], parts: Mapping[str, Callable[[], bool]]) -> None:
        """`checks`: part → function that returns "ok" or what is wrong, and may wait; `parts`: part → whether it runs."""
        self._checks, self._parts = checks, parts
        self._threads = ThreadPoolExecutor(len(checks), thread_name_prefix="health")
        self._running: dict[str, Future[str]] = {}

    def answers(self, scope: Scope) -> bool:
        return scope["path"] in (ALIVE, READY)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        response = await self._respond(scope)
        response.raw_headers += page_headers(scope["path"])
        await response(scope, receive, send)

    async def _respond(self, scope: Scope) -> Response:
        if scope["method"] not in ("GET", "HEAD"):
            return plain_error(not_allowed("GET", "HEAD"), {"Connection": "close"})
        if scope["path"] == ALIVE:
            return uncached("ok\n", media_type="text/plain")
        state = await self._ask_parts()
        return uncached(json.dumps(state, indent=1) + "\n", 200 if set(state.values()) == {"ok"} else 503, "application/json")

    async def _ask_parts(self) -> dict[str, str]:
        """Returns part → "ok" or what is wrong with it. A part that has not answered is not asked again until it does."""
        for name, check in self._checks.items():
            if name not in self._running:
                self._running[name] = self._threads.submit(check)
        waiting = {name: asyncio.wrap_future(future) for name, future in self._running.items()}
        await asyncio.wait(waiting.values(), timeout=READY_S)
        state = {name: one.result() if one.done() else f"no answer within {READY_S:g} s" for name, one in waiting.items()}
        for name in self._checks:
            if name in self._running and self._running[name].done():
                del self._running[name]
        return state | {name: "ok" if is_alive() else "not running" for name, is_alive in self._parts.items()}

    def close(self) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
