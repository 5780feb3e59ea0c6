"""The ASGI app: dispatches tile URLs, uploads and the 3D Portrayal Service to routes of their own, all others to Flask."""

import asyncio
import string
import time
from collections.abc import Awaitable, Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Final, cast
from urllib.parse import quote

from map3d.catalogue.workspace import Workspace
from map3d.errors import NotFound
from map3d.jobs.on_demand.on_demand import OnDemand
from map3d.uploads.uploads_in_use import uploads_in_use
from map3d.web.http.access import AccessControl
from map3d.web.http.current_app import close as close_catalogue
from map3d.web.http.health import READINESS
from map3d.web.http.settings import ServerSettings, settings_from_environment
from map3d.web.server.flask_app import create_flask_app
from map3d.web.server.flask_bridge import FlaskBridge
from map3d.web.server.metrics import Metrics
from map3d.web.server.observer import Observer
from map3d.web.server.request_body import read_body
from map3d.web.services.gis_tiles import TileServiceRoute
from map3d.web.services.portrayal_routes import PortrayalRoute
from map3d.web.studio.shared import PREVIEWS
from map3d.web.tiles.manifest_route import ManifestRoute
from map3d.web.tiles.tile_route import Messages, Receive, Scope, Send, TileRoute
from map3d.web.tiles.tiled_views import TiledViews
from map3d.web.uploads.upload_route import UploadRoute

FLASK_THREADS: Final = 8
_QUERY_SAFE: Final = string.punctuation
"""Characters of a query that stay unquoted. The bridge to Flask accepts only ASCII."""


class App:
    """ASGI 3; one per process."""

    def __init__(
        self, workspace: Workspace, settings: ServerSettings, metrics: Metrics | None = None, parts: Mapping[str, Callable[[], bool]] | None = None
    ) -> None:
        self.observer = Observer(metrics, settings.access_log) if metrics is not None or settings.access_log else None
        self.on_demand = None if settings.on_demand is None else OnDemand(workspace, settings.on_demand)
        self.tiles = TileRoute(workspace, settings.cache_bytes, self.on_demand)
        self.manifests = ManifestRoute(workspace)
        self.access = AccessControl(workspace)
        self.uploads = UploadRoute(workspace, self.access, lambda: uploads_in_use(self.access.accounts.catalogue))
        views = TiledViews(workspace)
        self.tile_services = TileServiceRoute(self.tiles, views)
        self.portrayal = PortrayalRoute(workspace, settings)
        self.flask = create_flask_app(workspace, settings, self.access, views, self.tiles.stores)
        self.flask.extensions[READINESS] = dict(parts or {}) | ({} if self.on_demand is None else {"on_demand": self.on_demand.is_alive})
        bridge = FlaskBridge(cast(Any, self.flask.wsgi_app), workers=FLASK_THREADS)
        self._flask_asgi: Callable[..., Awaitable[Any]] = bridge
        self._flask_threads: ThreadPoolExecutor = bridge.executor

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            if self.observer is None:
                await self._answer(scope, receive, send)
            else:
                self._count_on_demand(self.observer)
                await self.observer(self._answer, scope, receive, send)
        elif scope["type"] == "lifespan":
            await self._handle_lifespan(receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1000})

    def answer_early(self, scope: Scope) -> Messages | None:
        """Returns the answer to a request for a tile or a manifest that is in memory; None for all other requests. Any thread may call it."""
        if self.observer is None:
            return self.tiles.find_cached(scope) or self.manifests.find_cached(scope)
        if self.observer.access_log:
            return None
        start = time.perf_counter()
        found = self.tiles.find_cached(scope) or self.manifests.find_cached(scope)
        if found is not None:
            self.observer.count_early(scope, found[0]["status"], time.perf_counter() - start)
        return found

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self.tiles.matches(scope["path"]):
            await self.tiles(scope, receive, send)
        elif self.uploads.matches(scope["path"]):
            await self.uploads(scope, receive, send)
        elif self.portrayal.matches(scope["path"]):
            await self.portrayal(scope, receive, send)
        elif self.tile_services.matches(scope["path"], scope["query_string"]):
            await self.tile_services(scope, receive, send)
        elif not (self.manifests.matches(scope["path"], scope["method"]) and await self.manifests(scope, receive, send)):
            await self._ask_flask(scope, receive, send)

    async def _ask_flask(self, scope: Scope, receive: Receive, send: Send) -> None:
        body = await read_body(scope, receive, send)
        if body is not None:
            await self._flask_asgi({**scope, "query_string": quote(scope["query_string"], safe=_QUERY_SAFE).encode()}, body, send)

    def _count_on_demand(self, observer: Observer) -> None:
        if observer.metrics is not None:
            observer.metrics.set_counter(0, self.tiles.cache_hits)
            if self.on_demand is not None:
                observer.metrics.set_counter(1, self.on_demand.rendered)
                observer.metrics.set_counter(2, self.on_demand.cache.evicted)
                observer.metrics.set_waiting(len(self.on_demand.requests))

    async def close(self) -> None:
        await self._end_flask_threads()
        await self.tiles.close()
        await self.uploads.close()
        self.flask.extensions[PREVIEWS].close()
        await self.portrayal.close()
        if self.on_demand is not None:
            await asyncio.get_running_loop().run_in_executor(None, self.on_demand.close)
        self.access.close()
        await self.tile_services.close()
        with self.flask.app_context():
            close_catalogue()

    async def _end_flask_threads(self) -> None:
        """Answers the requests that wait for a thread. Threads hand their responses to this event loop; they would wait forever for one that has
        stopped."""
        await asyncio.get_running_loop().run_in_executor(None, self._flask_threads.shutdown)

    async def _handle_lifespan(self, receive: Receive, send: Send) -> None:
        while True:
            event = (await receive())["type"]
            if event == "lifespan.shutdown":
                await self.close()
            await send({"type": f"{event}.complete"})
            if event == "lifespan.shutdown":
                return


def create_app(
    workspace: Workspace | Path,
    settings: ServerSettings | None = None,
    metrics: Metrics | None = None,
    parts: Mapping[str, Callable[[], bool]] | None = None,
) -> App:
    """Creates the app of a workspace; without `settings`, with those of the environment. `parts`: further parts of the server that /readyz names,
    and functions that tell whether they work. Raises NotFound if the folder does not exist."""
    home = workspace if isinstance(workspace, Workspace) else Workspace(workspace)
    check_workspace(home)
    return App(home, settings or settings_from_environment(), metrics, parts)


def check_workspace(workspace: Workspace) -> None:
    """Raises NotFound if the folder does not exist."""
    if not workspace.root.is_dir():
        raise NotFound(f"no workspace at {workspace.root}; create a scene first (map3d create-scene), or name another folder with --workspace")
