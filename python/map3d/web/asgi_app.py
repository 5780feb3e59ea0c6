"""The ASGI app: tile URLs go to the thin route, all else to Flask."""

import string
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, Final, cast
from urllib.parse import quote

from a2wsgi import WSGIMiddleware

from map3d.catalogue.workspace import Workspace
from map3d.errors import NotFound
from map3d.web import document_routes
from map3d.web.flask_app import create_site
from map3d.web.tile_route import DEFAULT_CACHE_BYTES, Receive, Scope, Send, TileRoute

FLASK_THREADS: Final = 8
_QUERY_SAFE: Final = string.punctuation
"""What of a query is left as it is; the bridge to Flask takes ASCII only."""


class App:
    """ASGI 3; one per process."""

    def __init__(self, workspace: Workspace, cache_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self.tiles = TileRoute(workspace, cache_bytes)
        self.site = create_site(workspace)
        self._site_asgi: Callable[..., Awaitable[Any]] = WSGIMiddleware(cast(Any, self.site.wsgi_app), workers=FLASK_THREADS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            if self.tiles.owns(scope["path"]):
                await self.tiles(scope, receive, send)
            else:
                await self._site_asgi({**scope, "query_string": quote(scope["query_string"], safe=_QUERY_SAFE).encode()}, receive, send)
        elif scope["type"] == "lifespan":
            await self._live(receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1000})

    async def close(self) -> None:
        await self.tiles.close()
        with self.site.app_context():
            document_routes.close()

    async def _live(self, receive: Receive, send: Send) -> None:
        while True:
            event = (await receive())["type"]
            if event == "lifespan.shutdown":
                await self.close()
            await send({"type": f"{event}.complete"})
            if event == "lifespan.shutdown":
                return


def create_app(workspace: Workspace | Path, *, cache_bytes: int = DEFAULT_CACHE_BYTES) -> App:
    """The app of a workspace; raises NotFound when there is none."""
    home = workspace if isinstance(workspace, Workspace) else Workspace(workspace)
    if not home.root.is_dir():
        raise NotFound(f"no workspace at {home.root}: create a scene first (map3d create-scene), or name the folder with --workspace")
    return App(home, cache_bytes)
