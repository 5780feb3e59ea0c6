"""Answers requests by view functions: finds the rule, reads the body, calls the function in a thread, and sends its response or that to its error."""

import asyncio
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Final
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import compile_path

from map3d.web.http.asgi import Receive, Scope, Send
from map3d.web.http.bodies import read_body
from map3d.web.http.current import Request, Site, answering
from map3d.web.http.headers import page_headers
from map3d.web.http.http_errors import not_allowed
from map3d.web.http.routes import MOST_BYTES, Rule
from map3d.web.http.session_cookie import set_session
from map3d.web.server.error_pages import error_response

THREADS: Final = 8


class Views:
    """ASGI 3 for HTTP. Belongs to one event loop."""

    def __init__(self, site: Site, rules: Iterable[Rule]) -> None:
        self.site, self.rules = site, sorted(rules, key=lambda rule: rule.order)
        self.threads = ThreadPoolExecutor(THREADS, thread_name_prefix="views")
        by_path: dict[str, dict[str, Rule]] = {}
        for rule in self.rules:
            by_path.setdefault(rule.path, {})[rule.method] = rule
        self._paths = [(compile_path(path)[0], methods) for path, methods in by_path.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        request = Request(scope, self.site)
        view, most_bytes = self._find(scope)
        try:
            request.body = await read_body(scope, receive, most_bytes)
        except HTTPException as error:
            view = partial(_fail, error)
        response = await asyncio.get_running_loop().run_in_executor(self.threads, _respond, request, view)
        await response(scope, receive, send)

    def _find(self, scope: Scope) -> tuple[Callable[[], Response], int]:
        """Returns what answers a request, and the size of the body that it may have."""
        path = scope["path"]
        for pattern, methods in self._paths:
            found = pattern.match(path)
            if found is not None:
                rule = methods.get("GET" if scope["method"] == "HEAD" else scope["method"])
                if rule is None:
                    return partial(_fail, not_allowed(*sorted({*methods, "HEAD"} if "GET" in methods else methods))), MOST_BYTES
                return partial(rule.view, **found.groupdict()), rule.most_bytes
        if not any(pattern.match(f"{path}/") for pattern, _ in self._paths):
            return partial(_fail, HTTPException(404, "not found")), MOST_BYTES
        query = scope["query_string"].decode("latin-1")
        folder = f"./{quote(path.rpartition('/')[2], safe=':@!$&,;=+~')}/" + (f"?{query}" if query else "")
        return partial(_fail, HTTPException(308, "the address ends with /", {"Location": folder})), MOST_BYTES


def _fail(error: Exception) -> Response:
    raise error


def _respond(request: Request, view: Callable[[], Response]) -> Response:
    with answering(request):
        try:
            response = view()
        except Exception as error:
            response = error_response(error)
        if request.new_session is not None:
            set_session(response, request.new_session)
        response.raw_headers += page_headers(request["path"])
        return response
