"""The Flask app: pages and documents, with GET and HEAD only."""

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


class ReadOnlyFlask(Flask):
    """Flask without the OPTIONS method that it adds to every route."""

    def add_url_rule(
        self, rule: str, endpoint: str | None = None, view_func: Any = None, provide_automatic_options: bool | None = None, **options: Any
    ) -> None:
        super().add_url_rule(rule, endpoint, view_func, provide_automatic_options=False, **options)


def create_flask_app(workspace: Workspace) -> Flask:
    app = ReadOnlyFlask("map3d.web", static_folder="static", static_url_path="/static")
    app.config["MAX_CONTENT_LENGTH"] = MAX_REQUEST_BYTES
    app.config["WORKSPACE"] = workspace
    app.url_map.merge_slashes = False
    app.register_blueprint(pages)
    app.register_blueprint(documents)
    app.register_error_handler(Exception, _error_response)
    app.after_request(_add_security_headers)
    return app


def _error_response(error: Exception) -> Response:
    if isinstance(error, HTTPException):
        response = Response.force_type(error.get_response(), request.environ)
        if (error.code or 500) < 400:
            return response
    else:
        status, text = status_of(error)
        response = Response(text + "\n", status, mimetype="text/plain")
    response.headers["Cache-Control"] = "no-store"
    return response


def _add_security_headers(response: Response) -> Response:
    if request.path.startswith(PREFIXES):
        response.headers["Access-Control-Allow-Origin"] = "*"  # also on errors, so that pages of other origins can read the reason
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Content-Security-Policy"] = CONTENT_SECURITY_POLICY
    response.headers["Referrer-Policy"] = "same-origin"
    return response
