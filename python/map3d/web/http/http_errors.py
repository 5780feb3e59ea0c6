"""Maps exceptions to HTTP statuses. Error responses are never cached and never contain paths of the server."""

import logging
from typing import Final

from map3d.accounts import TooManySignIns
from map3d.errors import AlreadyExists, BadName, BadRequest, Forbidden, LimitExceeded, Map3dError, NotFound, SignInRequired, StoreError, Unavailable
from map3d.previews.preview_pool import PreviewBusy
from map3d.tile_services.tiled_view import NotOffered
from map3d.tiles.viewer_files import ViewerMissing

log: Final = logging.getLogger("map3d.web")

STATUS: Final[tuple[tuple[type[Exception], int, str | None], ...]] = (
    (NotOffered, 404, None),
    (NotFound, 404, "not found"),
    (BadName, 404, "not found"),
    (AlreadyExists, 409, None),
    (LimitExceeded, 413, None),
    (SignInRequired, 401, None),
    (Forbidden, 403, None),
    (TooManySignIns, 429, None),
    (BadRequest, 400, None),
    (ViewerMissing, 503, None),
    (Unavailable, 503, None),
    (PreviewBusy, 503, None),
    (StoreError, 503, "the tile store is temporarily unavailable; try again"),
    (Map3dError, 500, "the server's data is damaged; see the server log"),
    (Exception, 500, "internal server error; see the server log"),
)
"""(exception, status, text for the client; None for the exception's own text). The first match counts."""


def status_of(error: Exception) -> tuple[int, str]:
    """Returns the status and the text for the client. Logs server errors."""
    status, text = next((status, text) for kind, status, text in STATUS if isinstance(error, kind))
    if status >= 500 and not isinstance(error, Unavailable):
        log.error("%s", error, exc_info=not isinstance(error, Map3dError))
    return status, str(error) if text is None else text


def retry_headers(error: Exception) -> dict[str, str]:
    """Returns the header that says when to try again; empty for errors that stay."""
    return {"Retry-After": str(error.retry_s)} if isinstance(error, Unavailable) else {}
