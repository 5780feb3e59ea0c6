"""The ASGI app: dispatches tile URLs to the tile route, all others to Flask."""

import string
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, Final, cast
from urllib.parse import quote

from a2wsgi import WSGIMiddleware

from map3d.catalogue.workspace import Workspace
from map3d.errors import NotFound
from map3d.web import document_routes
from map3d.web.flask_app import create_flask_app
from map3d.web.tile_route import DEFAULT_CACHE_BYTES, Receive, Scope, Send, TileRoute

FLASK_THREADS: Final = 8
_QUERY_SAFE: Final = string.punctuation
"""Characters of a query that stay unquoted. The bridge to Flask accepts only ASCII."""


class App:
    """ASGI 3; one per process."""

    def __init__(self, workspace: Workspace, cache_bytes: int = DEFAULT_CACHE_BYTES) -> None:
        self.tiles = TileRoute(workspace, cache_bytes)
        self.flask = create_flask_app(workspace)
        self._flask_asgi: Callable[..., Awaitable[Any]] = WSGIMiddleware(cast(Any, self.flask.wsgi_app), workers=FLASK_THREADS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            if self.tiles.matches(scope["path"]):
                await self.tiles(scope, receive, send)
            else:
                await self._flask_asgi({**scope, "query_string": quote(scope["query_string"], safe=_QUERY_SAFE).encode()}, receive, send)
        elif scope["type"] == "lifespan":
            await self._handle_lifespan(receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1000})

    async def close(self) -> None:
        await self.tiles.close()
        with self.flask.app_context():
            document_routes.close()

    async def _handle_lifespan(self, receive: Receive, send: Send) -> None:
        while True:
            event = (await receive())["type"]
            if event == "lifespan.shutdown":
                await self.close()
            await send({"type": f"{event}.complete"})
            if event == "lifespan.shutdown":
                return


def create_app(workspace: Workspace | Path, *, cache_bytes: int = DEFAULT_CACHE_BYTES) -> App:
    """Creates the app of a workspace. Raises NotFound if the folder does not exist."""
    home = workspace if isinstance(workspace, Workspace) else Workspace(workspace)
    if not home.root.is_dir():
        raise NotFound(f"no workspace at {home.root}; create a scene first (map3d create-scene), or name another folder with --workspace")
    return App(home, cache_bytes)
