"""Maps exceptions to HTTP statuses. Error responses are never cached and never contain paths of the server."""

import logging
from collections.abc import Mapping
from typing import Final

from starlette.exceptions import HTTPException
from starlette.responses import Response

from map3d.accounts import TooManySignIns
from map3d.errors import AlreadyExists, BadName, BadRequest, Forbidden, LimitExceeded, Map3dError, NotFound, SignInRequired, StoreError, Unavailable
from map3d.previews.preview_pool import PreviewBusy
from map3d.tile_services.tiled_view import NotOffered
from map3d.tiles.viewer_files import ViewerMissing
from map3d.uploads import ChecksumMismatch, DiskFull, OffsetConflict, WriteInProgress

log: Final = logging.getLogger("map3d.web")

STATUS: Final[tuple[tuple[type[Exception], int, str | None], ...]] = (
    (OffsetConflict, 409, None),
    (WriteInProgress, 423, None),
    (ChecksumMismatch, 460, None),
    (DiskFull, 507, None),
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
    if isinstance(error, HTTPException):
        return error.status_code, error.detail
    status, text = next((status, text) for kind, status, text in STATUS if isinstance(error, kind))
    if status >= 500 and not isinstance(error, Unavailable | DiskFull):
        log.error("%s", error, exc_info=not isinstance(error, Map3dError))
    return status, str(error) if text is None else text


def error_headers(error: Exception) -> dict[str, str]:
    """Returns the headers of every response to the error: never cached; when to try again, how to sign in, which methods are allowed."""
    headers = {"Cache-Control": "no-store"}
    if isinstance(error, HTTPException):
        headers.update(error.headers or {})
    if isinstance(error, SignInRequired):
        headers["WWW-Authenticate"] = 'Bearer realm="map3d"'
    if isinstance(error, Unavailable | TooManySignIns):
        headers["Retry-After"] = str(error.retry_s if isinstance(error, Unavailable) else error.retry_after_s)
    return headers


def plain_error(error: Exception, headers: Mapping[str, str]) -> Response:
    """Returns the response to an error for programs: one line of text."""
    status, text = status_of(error)
    return Response(f"{text}\n", status, {**headers, **error_headers(error)}, "text/plain")


def not_allowed(*methods: str) -> HTTPException:
    """Returns the error for a method that is not one of these."""
    return HTTPException(405, f"method not allowed; use {' or '.join(methods)}", {"Allow": ", ".join(methods)})
