"""Error responses: pages for people, problems of the REST API, one line of text for other programs."""

from urllib.parse import quote

from starlette.responses import Response

from map3d.errors import SignInRequired
from map3d.web.api.declare_route import PREFIX as API
from map3d.web.api.openapi import problem_response
from map3d.web.http.accepting import prefers_html
from map3d.web.http.current import request
from map3d.web.http.host_folders import without_host_folders
from map3d.web.http.http_errors import error_headers, status_of
from map3d.web.http.responses import redirect, uncached
from map3d.web.pages.tools import relative, render, translate


def error_response(error: Exception) -> Response:
    """Returns the response to an error; never cached. A browser that has to sign in is sent to the form."""
    asked, headers = request(), error_headers(error)
    status, text = status_of(error)
    text = without_host_folders(text)
    if asked["path"].startswith(f"{API}/"):
        return problem_response(error, status, text, headers)
    if not prefers_html(asked.headers.get("accept", "")):
        return uncached(f"{text}\n", status, "text/plain", headers)
    if isinstance(error, SignInRequired) and asked["method"] == "GET":
        query = asked.scope["query_string"].decode("latin-1")
        back = quote(asked["path"]) + (f"?{query}" if query else "")
        return redirect(relative(f"sign-in?next={quote(back, safe='/')}"))
    return uncached(render("error.html", status=status, text=translate("not found") if text == "not found" else text), status, headers=headers)
