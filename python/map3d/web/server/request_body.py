"""Reads the bodies of requests before a thread of Flask takes them, so that a slow client holds no thread."""

import asyncio
from collections.abc import MutableMapping
from typing import Any, Final

from map3d.web.tiles.tile_route import Receive, Scope, Send

MAX_BODY_BYTES: Final = 2 << 20
"""Limit for all requests to Flask, which has smaller limits for most routes."""
BODY_S: Final = 30.0


class _TooLarge(Exception):
    pass


async def read_body(scope: Scope, receive: Receive, send: Send) -> Receive | None:
    """Returns a `receive` that gives the whole body at once. For a body that is too large or too slow, answers 413 or 408 itself and
    returns None."""
    if not any(key in (b"content-length", b"transfer-encoding") and value != b"0" for key, value in scope["headers"]):
        return _replay(b"")
    try:
        return _replay(await asyncio.wait_for(_collect(receive), BODY_S))
    except _TooLarge:
        await _refuse(send, 413, f"the body has more than {MAX_BODY_BYTES:,} bytes; send files to /uploads/\n")
    except TimeoutError:
        await _refuse(send, 408, f"the body did not arrive within {BODY_S:.0f} s\n")
    return None


async def _collect(receive: Receive) -> bytes:
    parts, size = list[bytes](), 0
    while True:
        event = await receive()
        parts.append(event.get("body", b""))
        size += len(parts[-1])
        if size > MAX_BODY_BYTES:
            raise _TooLarge
        if not event.get("more_body", False):
            return b"".join(parts)


def _replay(body: bytes) -> Receive:
    events: list[MutableMapping[str, Any]] = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive() -> MutableMapping[str, Any]:
        return events.pop() if events else {"type": "http.disconnect"}

    return receive


async def _refuse(send: Send, status: int, text: str) -> None:
    body = text.encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode()), (b"cache-control", b"no-store")]
    await send({"type": "http.response.start", "status": status, "headers": [*headers, (b"connection", b"close")]})
    await send({"type": "http.response.body", "body": body})
