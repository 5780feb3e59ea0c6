"""The one table of exceptions and HTTP statuses. An error is never cached, and never tells paths of the server."""

import logging
from typing import Final

from map3d.errors import AlreadyExists, BadName, BadRequest, LimitExceeded, Map3dError, NotFound, StoreError
from map3d.tiles.viewer_files import ViewerMissing

log: Final = logging.getLogger("map3d.web")

STATUS: Final[tuple[tuple[type[Exception], int, str | None], ...]] = (
    (NotFound, 404, "not found"),
    (BadName, 404, "not found"),
    (AlreadyExists, 409, None),
    (LimitExceeded, 413, None),
    (BadRequest, 400, None),
    (ViewerMissing, 503, None),
    (StoreError, 503, "the store cannot be read now; try again"),
    (Map3dError, 500, "the server's data is damaged; its log says where"),
    (Exception, 500, "internal error"),
)
"""First match wins. (exception, status, what the client is told; None: the exception's own text)."""


def status_of(error: Exception) -> tuple[int, str]:
    """The status and the text for the client; logs what is the server's fault."""
    status, text = next((status, text) for kind, status, text in STATUS if isinstance(error, kind))
    if status >= 500:
        log.error("%s", error, exc_info=not isinstance(error, Map3dError))
    return status, str(error) if text is None else text
