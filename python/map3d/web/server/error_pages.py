"""Error responses: pages for people, one line of text for programs."""

from flask import render_template, request, url_for
from werkzeug import Response
from werkzeug.exceptions import HTTPException

from map3d.accounts import TooManySignIns
from map3d.errors import SignInRequired
from map3d.web.api.declare_route import PREFIX as API
from map3d.web.api.openapi import problem_response
from map3d.web.http.host_folders import without_host_folders
from map3d.web.http.http_errors import retry_headers, status_of
from map3d.web.pages.tools import relative, translate


def error_response(error: Exception) -> Response:
    """Returns the response to an error; never cached. A browser that has to sign in is sent to the form."""
    if isinstance(error, HTTPException):
        response = Response.force_type(error.get_response(), request.environ)
        if (error.code or 500) < 400:
            return response
        status, text = response.status_code, error.description or ""
    else:
        status, text = status_of(error)
        text = without_host_folders(text)
        response = Response(text + "\n", status, mimetype="text/plain")
    if request.path.startswith(f"{API}/"):
        response = _problem(error, status, text, response)
    elif wants_page():
        response = _page(error, status, text, response)
    if isinstance(error, SignInRequired) and response.status_code == 401:
        response.headers["WWW-Authenticate"] = 'Bearer realm="map3d"'
    if isinstance(error, TooManySignIns):
        response.headers["Retry-After"] = str(error.retry_after_s)
    response.headers.update(retry_headers(error))
    response.headers["Cache-Control"] = "no-store"
    return response


def _problem(error: Exception, status: int, text: str, plain: Response) -> Response:
    response = problem_response(error, status, text)
    if "Allow" in plain.headers:
        response.headers["Allow"] = plain.headers["Allow"]
    return response


def wants_page() -> bool:
    """Returns whether the request prefers HTML to plain text and JSON, as browsers' page loads do."""
    return request.accept_mimetypes.best_match(("text/plain", "application/json", "text/html")) == "text/html"


def _page(error: Exception, status: int, text: str, plain: Response) -> Response:
    if isinstance(error, SignInRequired) and request.method == "GET":
        back = request.full_path.rstrip("?")
        return Response(status=303, headers={"Location": relative(url_for("accounts.sign_in", next=back))})
    response = Response(
        render_template("error.html", status=status, text=translate("not found") if text == "not found" else text), status, mimetype="text/html"
    )
    if "Allow" in plain.headers:
        response.headers["Allow"] = plain.headers["Allow"]
    return response
