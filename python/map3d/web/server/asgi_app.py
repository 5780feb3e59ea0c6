"""The ASGI app: plain ASGI routes for what is asked for often, takes long or streams; view functions for all else."""

import asyncio
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from itertools import chain
from pathlib import Path
from typing import Any, Final

from starlette.routing import Router

from map3d.catalogue.workspace import Workspace
from map3d.errors import NotFound
from map3d.jobs.on_demand.on_demand import OnDemand
from map3d.previews.preview_pool import PreviewPool
from map3d.uploads.uploads_in_use import uploads_in_use
from map3d.web.api.routes import api
from map3d.web.http.access import AccessControl
from map3d.web.http.asgi import EMPTY, Message, Messages, PlainRoute, Receive, Scope, Send
from map3d.web.http.current import Site
from map3d.web.http.health import readiness_checks
from map3d.web.http.settings import ServerSettings, settings_from_environment
from map3d.web.http.shared_catalogue import SharedCatalogue
from map3d.web.http.tiled_views import TiledViews
from map3d.web.pages.page_routes import pages
from map3d.web.pages.tools import TEMPLATES
from map3d.web.server.health_route import HealthRoute
from map3d.web.server.metrics import Metrics
from map3d.web.server.observer import Observer
from map3d.web.server.views import Views
from map3d.web.services.gis_documents import tile_services
from map3d.web.services.gis_tiles import TileServiceRoute
from map3d.web.services.portrayal_routes import PortrayalRoute
from map3d.web.studio.account_routes import accounts
from map3d.web.studio.operation_pages import operation_pages
from map3d.web.studio.operation_words import message_text
from map3d.web.studio.rendering_pages import rendering_pages
from map3d.web.studio.scene_pages import scene_pages
from map3d.web.tiles.document_routes import documents
from map3d.web.tiles.manifest_route import ManifestRoute
from map3d.web.tiles.picture_routes import pictures
from map3d.web.tiles.tile_route import TileRoute
from map3d.web.uploads.upload_route import UploadRoute

ROUTES: Final = (pages, documents, accounts, api, tile_services, pictures, scene_pages, rendering_pages, operation_pages)
TEMPLATES.filters["message_text"] = message_text


class App:
    """ASGI 3; one per process."""

    def __init__(
        self, workspace: Workspace, settings: ServerSettings, metrics: Metrics | None = None, parts: Mapping[str, Callable[[], bool]] | None = None
    ) -> None:
        self.observer = Observer(metrics, settings.access_log, settings.trusted_proxies) if metrics is not None or settings.access_log else None
        self.on_demand = None if settings.on_demand is None else OnDemand(workspace, settings.on_demand)
        catalogue = SharedCatalogue(workspace)
        self.tiles = TileRoute(catalogue, settings.cache_bytes, self.on_demand)
        access, tiled = AccessControl(catalogue), TiledViews(catalogue)
        running = dict(parts or {}) | ({} if self.on_demand is None else {"on_demand": self.on_demand.is_alive})
        self.health = HealthRoute(readiness_checks(catalogue, writes=self.on_demand is not None), running)
        self.site = Site(catalogue, settings, access, self.tiles.stores, tiled, PreviewPool(workspace))
        self.views = Views(self.site, chain.from_iterable(ROUTES))
        self.manifests = ManifestRoute(workspace, self.views)
        self.uploads = UploadRoute(workspace, access, lambda: uploads_in_use(catalogue()))
        self.portrayal = PortrayalRoute(workspace, settings, self.views.bodies)
        self.tile_services = TileServiceRoute(self.tiles, tiled)
        self._plain: tuple[PlainRoute, ...] = (self.tiles, self.health, self.uploads, self.portrayal, self.tile_services, self.manifests)
        self._lifespan = Router(lifespan=self._live)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._lifespan(scope, receive, send)
        elif self.observer is None:
            await self._answer(scope, receive, send)
        else:
            self._count_on_demand(self.observer)
            await self.observer(self._answer, scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["method"] == "HEAD":
            send = _without_body(send)
        for route in self._plain:
            if route.answers(scope):
                await route(scope, receive, send)
                return
        await self.views(scope, receive, send)

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

    def _count_on_demand(self, observer: Observer) -> None:
        if observer.metrics is not None:
            observer.metrics.set_counter(0, self.tiles.cache_hits)
            if self.on_demand is not None:
                observer.metrics.set_counter(1, self.on_demand.rendered)
                observer.metrics.set_counter(2, self.on_demand.cache.evicted)
                observer.metrics.set_waiting(len(self.on_demand.requests))

    async def close(self) -> None:
        """Answers the requests that wait for a thread, then closes all. Threads hand their responses to this event loop."""
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, self.views.close)
        await self.tiles.close()
        await self.uploads.close()
        await self.portrayal.close()
        if self.on_demand is not None:
            await loop.run_in_executor(None, self.on_demand.close)
        await self.tile_services.close()
        self.health.close()
        self.site.close()

    @asynccontextmanager
    async def _live(self, _app: Any) -> AsyncIterator[None]:
        yield
        await self.close()


def _without_body(send: Send) -> Send:
    """Returns a function that sends the answer to a HEAD request."""

    async def send_head(message: Message) -> None:
        await send(message if message["type"] == "http.response.start" else EMPTY)

    return send_head


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
