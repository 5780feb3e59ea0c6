"""Absolute URLs of the server's own pages and documents.

Redirects and pages use relative URLs, which are right behind every proxy. Documents in which standards demand absolute URLs get them from
`public_url`.
"""

from flask import current_app, request

from map3d.web.http.settings import ServerSettings


def public_url(path: str = "") -> str:
    """Returns the absolute URL of a path below the server's root, such as `ogc/collections`; for an empty path that of the root, without a slash at
    its end.

    It begins with the setting `public_url`. Without that setting, it begins with the host that the client named in the current request: right without
    a proxy, but for that client alone, so cache nothing that contains it.
    """
    settings: ServerSettings = current_app.config["SETTINGS"]
    root = settings.public_url or request.host_url.rstrip("/")
    return f"{root}/{path.lstrip('/')}" if path else root
