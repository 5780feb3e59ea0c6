"""Reads the bodies of requests on the event loop, so that a slow client holds no thread, and bounds the memory that they take."""

import asyncio
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from starlette.exceptions import HTTPException

from map3d.web.http.asgi import Receive, Scope
from map3d.web.http.conditions import header

BODY_S: Final = 30.0
"""Time in which a body has to arrive."""
MOST_BYTES: Final = 64 << 20
"""Bodies that a process holds at a time."""
MOST_STRANGER_BYTES: Final = 64 << 10
"""Bodies that a process holds at a time for one client that has not signed in."""
_CLOSE: Final = {"Connection": "close"}


def has_body(scope: Scope) -> bool:
    return header(scope["headers"], b"content-length") not in (b"", b"0") or bool(header(scope["headers"], b"transfer-encoding"))


class Bodies:
    """The bodies that a process holds. Belongs to one event loop."""

    def __init__(self) -> None:
        self.held_bytes = 0
        self._strangers: Counter[str] = Counter()

    @contextmanager
    def hold(self, stranger: str | None = None) -> Iterator["HeldBody"]:
        """Holds a body within the context. `stranger`: the address of a client that has not signed in."""
        body = HeldBody(self, stranger)
        try:
            yield body
        finally:
            self._add(-body.size_bytes, stranger)

    def take(self, size: int, stranger: str | None) -> None:
        """Raises HTTPException: 429 for a client that has not signed in and sends too much at a time, 503 if all send too much."""
        if stranger is not None and self._strangers[stranger] + size > MOST_STRANGER_BYTES:
            raise HTTPException(429, "too many requests at a time from this address; try again", _CLOSE | {"Retry-After": "5"})
        if self.held_bytes + size > MOST_BYTES:
            raise HTTPException(503, "too many large requests at a time; try again", _CLOSE | {"Retry-After": "5"})
        self._add(size, stranger)

    def _add(self, size: int, stranger: str | None) -> None:
        self.held_bytes += size
        if stranger is not None:
            self._strangers[stranger] += size
            if self._strangers[stranger] <= 0:
                del self._strangers[stranger]


@dataclass
class HeldBody:
    """A body that arrives. `size_bytes`: what is counted for it."""

    bodies: Bodies
    stranger: str | None
    size_bytes: int = field(default=0, init=False)

    async def read(self, scope: Scope, receive: Receive, most_bytes: int) -> bytes:
        """Returns the whole body. Raises HTTPException: 413 for one that is too large, as soon as that is known, 408 for one that is too slow, 400
        for one without an end, 429 and 503 for more than may be held."""
        length = header(scope["headers"], b"content-length")
        if length.isdigit() and int(length[:20]) > most_bytes:
            raise _too_large(most_bytes)
        try:
            return await asyncio.wait_for(self._collect(receive, most_bytes), BODY_S)
        except TimeoutError:
            raise HTTPException(408, f"the body did not arrive within {BODY_S:.0f} s", _CLOSE) from None

    async def _collect(self, receive: Receive, most_bytes: int) -> bytes:
        parts = list[bytes]()
        while True:
            event = await receive()
            if event["type"] != "http.request":
                raise HTTPException(400, "the connection broke before the end of the body")
            part = event.get("body", b"")
            if self.size_bytes + len(part) > most_bytes:
                raise _too_large(most_bytes)
            self.bodies.take(len(part), self.stranger)
            self.size_bytes += len(part)
            parts.append(part)
            if not event.get("more_body"):
                return b"".join(parts)


def _too_large(most_bytes: int) -> HTTPException:
    return HTTPException(413, f"the body has more than {most_bytes:,} bytes, which is the most here; files go to /uploads/", _CLOSE)
