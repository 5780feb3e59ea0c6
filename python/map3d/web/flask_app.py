"""The Flask app: pages and documents. It has GET and HEAD only."""

from typing import Any

from flask import Flask, request
from werkzeug import Response
from werkzeug.exceptions import HTTPException

from map3d.catalogue.workspace import Workspace
from map3d.web.document_routes import documents
from map3d.web.http_errors import status_of
from map3d.web.page_routes import pages
from map3d.web.tile_route import PREFIXES

CONTENT_SECURITY_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' blob: data:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'"
)
MAX_REQUEST_BYTES = 64 << 10


class Site(Flask):
    """Flask without the OPTIONS method that it would add to every route."""

    def add_url_rule(
        self, rule: str, endpoint: str | None = None, view_func: Any = None, provide_automatic_options: bool | None = None, **options: Any
    ) -> None:
        super().add_url_rule(rule, endpoint, view_func, provide_automatic_options=False, **options)


def create_site(workspace: Workspace) -> Flask:
    site = Site("map3d.web", static_folder="static", static_url_path="/static")
    site.config["MAX_CONTENT_LENGTH"] = MAX_REQUEST_BYTES
    site.config["WORKSPACE"] = workspace
    site.url_map.merge_slashes = False
    site.register_blueprint(pages)
    site.register_blueprint(documents)
    site.register_error_handler(Exception, _refuse)
    site.after_request(_protect)
    return site


def _refuse(error: Exception) -> Response:
    if isinstance(error, HTTPException):
        response = Response.force_type(error.get_response(), request.environ)
        if (error.code or 500) < 400:
            return response
    else:
        status, text = status_of(error)
        response = Response(text + "\n", status, mimetype="text/plain")
    response.headers["Cache-Control"] = "no-store"
    return response


def _protect(response: Response) -> Response:
    if request.path.startswith(PREFIXES):
        response.headers["Access-Control-Allow-Origin"] = "*"  # on refusals too: a page of another origin learns why
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY
    response.headers["Referrer-Policy"] = "same-origin"
    return response
