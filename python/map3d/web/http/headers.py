"""Headers that all responses of a kind have."""

from collections.abc import Mapping
from typing import Final

from map3d.publish.page_head import VIEWER_POLICY
from map3d.web.http.asgi import Headers

IMMUTABLE: Final = b"public, max-age=31536000, immutable"
NO_CACHE: Final = b"no-cache"
NO_STORE: Final = b"no-store"
TILES: Final = ("/tiles/", "/view/")
"""Where tiles are. The viewer's page loads them relative to its own folder, hence the second one."""
CROSS_ORIGIN: Final = (*TILES, "/ogc", "/wmts", "/tilejson/", "/xyz/", "/gis/")
"""Paths that pages of other origins may read."""
ANY_ORIGIN: Final[Mapping[str, str]] = {
    "Access-Control-Allow-Origin": "*",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Resource-Policy": "cross-origin",
}
"""Headers of tiles and pictures, which pages of other origins may show."""
ANYWHERE: Final = "*"
OWN: Final = "'self'"
CONTENT_SECURITY_POLICY: Final = (
    "default-src 'self'; img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' blob: data:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'"
)


def raw(headers: Mapping[str, str]) -> Headers:
    return [(name.lower().encode("latin-1"), value.encode("latin-1")) for name, value in headers.items()]


def page_headers(path: str, frame_ancestors: str = ANYWHERE) -> Headers:
    """Returns the headers of pages and documents, errors included. `frame_ancestors`: pages that may show maps in a frame; other pages may stand only
    in frames of this server."""
    is_map = path.startswith("/view/")
    policy = f"{VIEWER_POLICY if is_map else CONTENT_SECURITY_POLICY}; frame-ancestors {frame_ancestors if is_map else OWN}"
    headers = {"X-Content-Type-Options": "nosniff", "Content-Security-Policy": policy, "Referrer-Policy": "same-origin"}
    return raw(headers | ({"Access-Control-Allow-Origin": "*"} if path.startswith(CROSS_ORIGIN) else {}))
