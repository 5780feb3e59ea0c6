"""The HTTP front: parses requests, calls the functions that the command line calls too, and formats their results."""

from map3d.web.http.public_url import public_url
from map3d.web.server.asgi_app import create_app
from map3d.web.server.serve import serve

__all__ = ["create_app", "public_url", "serve"]
