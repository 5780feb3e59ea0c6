"""Reads the bodies of requests on the event loop, so that a slow client holds no thread."""

import asyncio
from typing import Final

from starlette.exceptions import HTTPException

from map3d.web.http.asgi import Receive, Scope

BODY_S: Final = 30.0
"""Time in which a body has to arrive."""
_CLOSE: Final = {"Connection": "close"}


async def read_body(scope: Scope, receive: Receive, most_bytes: int) -> bytes:
    """Returns the whole body. Raises HTTPException: 413 for one that is too large, as soon as that is known, 408 for one that is too slow."""
    length = next((value for name, value in scope["headers"] if name == b"content-length"), b"")
    if length == b"0" or not (length or any(name == b"transfer-encoding" for name, _ in scope["headers"])):
        return b""
    is_larger = length.isdigit() and int(length[:20]) > most_bytes
    body = b"" if is_larger else await collect(receive, most_bytes)
    if is_larger or len(body) > most_bytes:
        raise HTTPException(413, f"the body has more than {most_bytes:,} bytes; send files to /uploads/", _CLOSE)
    return body


async def collect(receive: Receive, most_bytes: int) -> bytes:
    """Returns the body, or its beginning of more than `most_bytes` if it is longer. Raises HTTPException: 408 for one that is too slow, 400
    for one without an end."""
    try:
        return await asyncio.wait_for(_collect(receive, most_bytes), BODY_S)
    except TimeoutError:
        raise HTTPException(408, f"the body did not arrive within {BODY_S:.0f} s", _CLOSE) from None


async def _collect(receive: Receive, most_bytes: int) -> bytes:
    body = bytearray()
    while True:
        event = await receive()
        if event["type"] != "http.request":
            raise HTTPException(400, "the connection broke before the end of the body")
        body += event.get("body", b"")
        if not event.get("more_body") or len(body) > most_bytes:
            return bytes(body)
