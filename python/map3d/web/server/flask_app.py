"""The Flask app: pages and documents. A route that accepts another method than GET and HEAD has a guard of `map3d.web.http.access`."""

from typing import Any
from urllib.parse import urlsplit

from flask import Flask, request
from werkzeug import Response
from werkzeug.routing import RequestRedirect

from map3d.catalogue.workspace import Workspace
from map3d.previews.preview_pool import PreviewPool
from map3d.publish.page_head import VIEWER_POLICY
from map3d.web.api.routes import api
from map3d.web.http.access import ACCESS, AccessControl, check_guarded
from map3d.web.http.open_stores import OpenStores
from map3d.web.http.settings import ServerSettings
from map3d.web.pages.page_routes import pages
from map3d.web.pages.tools import add_page_tools
from map3d.web.server.error_pages import error_response
from map3d.web.services.gis_documents import SERVICE_PREFIXES, VIEWS, tile_services
from map3d.web.studio.account_routes import accounts
from map3d.web.studio.operation_pages import operation_pages
from map3d.web.studio.operation_words import message_text
from map3d.web.studio.rendering_pages import rendering_pages
from map3d.web.studio.scene_pages import scene_pages
from map3d.web.studio.shared import PREVIEWS
from map3d.web.tiles.document_routes import documents
from map3d.web.tiles.picture_routes import STORES, pictures
from map3d.web.tiles.tile_route import PREFIXES
from map3d.web.tiles.tiled_views import TiledViews

CONTENT_SECURITY_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' blob: data:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'"
)
MAX_REQUEST_BYTES = 64 << 10


class GuardedFlask(Flask):
    """Flask that refuses routes for writing without a guard, and without the OPTIONS method that it adds to every route."""

    def add_url_rule(
        self, rule: str, endpoint: str | None = None, view_func: Any = None, provide_automatic_options: bool | None = None, **options: Any
    ) -> None:
        check_guarded(rule, view_func, options.get("methods"))
        super().add_url_rule(rule, endpoint, view_func, provide_automatic_options=False, **options)


def create_flask_app(workspace: Workspace, settings: ServerSettings, access: AccessControl, views: TiledViews, stores: OpenStores) -> Flask:
    app = GuardedFlask("map3d.web", static_folder="static", static_url_path="/static")
    app.config["MAX_CONTENT_LENGTH"] = MAX_REQUEST_BYTES
    app.config["WORKSPACE"] = workspace
    app.config["SETTINGS"] = settings
    app.extensions[ACCESS] = access
    app.url_map.merge_slashes = False
    app.register_blueprint(pages)
    app.register_blueprint(documents)
    app.register_blueprint(accounts)
    app.register_blueprint(api)
    app.register_blueprint(tile_services)
    app.extensions[VIEWS] = views
    app.register_blueprint(pictures)
    app.extensions[STORES] = stores
    for blueprint in (scene_pages, rendering_pages, operation_pages):
        app.register_blueprint(blueprint)
    app.extensions[PREVIEWS] = PreviewPool(workspace)
    add_page_tools(app)
    app.jinja_env.filters["message_text"] = message_text
    app.register_error_handler(Exception, error_response)
    app.after_request(_make_redirect_relative)
    app.after_request(_add_security_headers)
    return app


def _make_redirect_relative(response: Response) -> Response:
    """Changes Flask's only own redirect, from a path without a slash at its end to the path with it, which names the host of the request."""
    if isinstance(request.routing_exception, RequestRedirect):
        target = urlsplit(request.routing_exception.new_url)
        response.location = f"./{target.path.split('/')[-2]}/" + (f"?{target.query}" if target.query else "")
    return response


def _add_security_headers(response: Response) -> Response:
    if request.path.startswith(PREFIXES + SERVICE_PREFIXES):
        response.headers["Access-Control-Allow-Origin"] = "*"  # also on errors, so that pages of other origins can read the reason
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Content-Security-Policy"] = VIEWER_POLICY if request.path.startswith("/view/") else CONTENT_SECURITY_POLICY
    response.headers["Referrer-Policy"] = "same-origin"
    return response
