"""Web service: a thin ASGI route serves tiles, Flask serves everything else. Read-only, without logic of its own."""

from map3d.web.asgi_app import create_app
from map3d.web.public_url import public_url
from map3d.web.server import serve

__all__ = ["create_app", "public_url", "serve"]
