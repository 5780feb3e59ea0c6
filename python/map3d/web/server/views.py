"""Answers requests by view functions: finds the rule, reads the body of those who may send one, calls the function in a thread, and sends its
response or that to its error."""

import asyncio
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Final, TypeVar
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.responses import Response
from starlette.routing import compile_path

from map3d.catalogue import Role
from map3d.web.http.asgi import Receive, Scope, Send
from map3d.web.http.bodies import Bodies, has_body
from map3d.web.http.clients import client_address
from map3d.web.http.current import Request, Site, answering
from map3d.web.http.headers import page_headers
from map3d.web.http.http_errors import not_allowed
from map3d.web.http.routes import Rule
from map3d.web.http.session_cookie import set_session
from map3d.web.server.error_pages import error_response

THREADS: Final = 8
FILE_THREADS: Final = 2

View = Callable[[], Response]
Result = TypeVar("Result")


class Views:
    """ASGI 3 for HTTP. Belongs to one event loop."""

    def __init__(self, site: Site, rules: Iterable[Rule]) -> None:
        self.site, self.rules = site, sorted(rules, key=lambda rule: rule.order)
        self.bodies = Bodies()
        self.threads = ThreadPoolExecutor(THREADS, thread_name_prefix="views")
        self.file_threads = ThreadPoolExecutor(FILE_THREADS, thread_name_prefix="files")
        by_path: dict[str, dict[str, Rule]] = {}
        for rule in self.rules:
            by_path.setdefault(rule.path, {})[rule.method] = rule
        self._paths = [(compile_path(path)[0], methods) for path, methods in by_path.items()]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        request = Request(scope, self.site)
        view, rule = self._find(scope)
        if has_body(scope):
            response = await self._receive(request, receive, view, rule)
        else:
            threads = self.file_threads if rule is not None and rule.is_file else self.threads
            response = await asyncio.get_running_loop().run_in_executor(threads, _respond, request, view)
        await response(scope, receive, send)

    async def _receive(self, request: Request, receive: Receive, view: View, rule: Rule | None) -> Response:
        """Answers a request with a body, which is read only where a rule wants one, and only from callers with the rule's role."""
        wanted = rule if rule is not None and rule.reads_body else None
        role = None if wanted is None else wanted.role
        error = None if role is None else await self._run(_refusal, request, role)
        stranger = client_address(request.scope, self.site.settings.trusted_proxies) if role is None else None
        with self.bodies.hold(stranger) as body:
            if wanted is not None and error is None:
                try:
                    request.body = await body.read(request.scope, receive, wanted.most_bytes)
                except HTTPException as refused:
                    error = refused
            response = await self._run(_respond, request, view if error is None else partial(_fail, error))
        if error is not None or wanted is None:
            response.headers["Connection"] = "close"
        return response

    def close(self) -> None:
        """Answers the requests that wait for a thread."""
        self.file_threads.shutdown()
        self.threads.shutdown()

    async def _run(self, function: Callable[..., Result], *arguments: Any) -> Result:
        return await asyncio.get_running_loop().run_in_executor(self.threads, function, *arguments)

    def _find(self, scope: Scope) -> tuple[View, Rule | None]:
        """Returns what answers a request, and the rule of its path and method."""
        path = scope["path"]
        for pattern, methods in self._paths:
            found = pattern.match(path)
            if found is not None:
                rule = methods.get("GET" if scope["method"] == "HEAD" else scope["method"])
                if rule is None:
                    return partial(_fail, not_allowed(*sorted({*methods, "HEAD"} if "GET" in methods else methods))), None
                return partial(rule.view, **found.groupdict()), rule
        if not any(pattern.match(f"{path}/") for pattern, _ in self._paths):
            return partial(_fail, HTTPException(404, "not found")), None
        query = scope["query_string"].decode("latin-1")
        folder = f"./{quote(path.rpartition('/')[2], safe=':@!$&,;=+~')}/" + (f"?{query}" if query else "")
        return partial(_fail, HTTPException(308, "the address ends with /", {"Location": folder})), None


def _refusal(request: Request, role: Role) -> Exception | None:
    """Returns why the caller may not send a request that needs a role. The value that proves a form is in the body, so it is looked at later."""
    try:
        request.site.access.check(request.caller, role, "GET", None)
    except Exception as error:
        return error
    return None


def _fail(error: Exception) -> Response:
    raise error


def _respond(request: Request, view: View) -> Response:
    with answering(request):
        try:
            response = view()
        except Exception as error:
            response = error_response(error)
        if request.new_session is not None:
            set_session(response, request.new_session)
        response.raw_headers += page_headers(request["path"], request.site.settings.frame_ancestors)
        return response
