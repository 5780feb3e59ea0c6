"""The web service: tiles by a thin ASGI route, everything else by Flask behind it. Read-only; no logic of its own."""

from map3d.web.asgi_app import create_app
from map3d.web.server import serve

__all__ = ["create_app", "serve"]
