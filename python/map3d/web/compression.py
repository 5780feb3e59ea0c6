"""Text compressed for who can read that."""

import gzip
from functools import lru_cache
from typing import Final

from flask import Response, request

PACK_FROM_BYTES: Final = 1024
_TEXT: Final = ("text/", "application/json", "application/javascript")


def pack(response: Response) -> Response:
    """The response, compressed if it is text of some length and the client takes gzip. Its ETag becomes a weak one: the same text, other bytes."""
    if response.status_code != 200 or not (response.mimetype or "").startswith(_TEXT):
        return response
    response.headers["Vary"] = "Accept-Encoding"
    etag, _ = response.get_etag()
    if etag is not None:
        response.set_etag(etag, weak=True)
    if request.accept_encodings.quality("gzip") <= 0:
        return response
    response.direct_passthrough = False
    data = response.get_data()
    if len(data) < PACK_FROM_BYTES:
        return response
    response.set_data(_packed(data))
    response.headers["Content-Encoding"] = "gzip"
    return response


@lru_cache(maxsize=32)
def _packed(data: bytes) -> bytes:
    return gzip.compress(data, compresslevel=6, mtime=0)
