"""Absolute URLs of the server's own pages and documents.

Redirects and pages use relative URLs, which are right behind every proxy. Documents in which standards demand absolute URLs get them from
`public_url`.
"""

import re
from typing import Final

from map3d.web.http.asgi import Scope
from map3d.web.http.clients import client_scheme
from map3d.web.http.conditions import header
from map3d.web.http.current import request, site
from map3d.web.http.settings import ServerSettings

_HOST: Final = re.compile(r"[A-Za-z0-9._\-]+(:[0-9]+)?|\[[0-9a-fA-F:.]+\](:[0-9]+)?", re.ASCII)


def public_url(path: str = "") -> str:
    """Returns the absolute URL of a path below the server's root, such as `ogc/collections`; for an empty path that of the root, without a slash at
    its end.

    It begins with the setting `public_url`. Without that setting, it begins with the host that the client named in the current request: right without
    a proxy, but for that client alone, so cache nothing that contains it.
    """
    root = root_url(site().settings, request().scope)
    return f"{root}/{path.lstrip('/')}" if path else root


def root_url(settings: ServerSettings, scope: Scope) -> str:
    """Returns the absolute URL of the server's root for the client of a request."""
    host = header(scope["headers"], b"host").decode("latin-1")
    return settings.public_url or f"{client_scheme(scope, settings.trusted_proxies)}://{host if _HOST.fullmatch(host) else 'localhost'}"
