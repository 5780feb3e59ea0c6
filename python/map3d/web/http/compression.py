"""Compresses text responses."""

import gzip
from functools import lru_cache
from typing import Final

from flask import Response, request

MIN_BYTES: Final = 1024
_TEXT_TYPES: Final = ("text/", "application/json", "application/javascript", "image/svg+xml")


def compress(response: Response) -> Response:
    """Compresses the response if it is text of at least MIN_BYTES and the client accepts gzip. Its ETag becomes weak: same text, other bytes."""
    if response.status_code != 200 or not (response.mimetype or "").startswith(_TEXT_TYPES):
        return response
    response.headers["Vary"] = "Accept-Encoding"
    etag, _ = response.get_etag()
    if etag is not None:
        response.set_etag(etag, weak=True)
    if request.accept_encodings.quality("gzip") <= 0:
        return response
    response.direct_passthrough = False
    data = response.get_data()
    if len(data) < MIN_BYTES:
        return response
    response.set_data(gzip_bytes(data))
    response.headers["Content-Encoding"] = "gzip"
    return response


@lru_cache(maxsize=32)
def gzip_bytes(data: bytes) -> bytes:
    return gzip.compress(data, compresslevel=6, mtime=0)
