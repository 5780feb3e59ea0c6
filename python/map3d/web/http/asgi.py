"""Names of what ASGI passes around, and routes without view functions."""

from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, Final, Protocol

Message = MutableMapping[str, Any]
Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]
Messages = tuple[Message, Message]
"""The start and the body of a response."""
EMPTY: Final[Message] = {"type": "http.response.body", "body": b""}
"""The body of an answer without one."""


class PlainRoute(Protocol):
    """An ASGI application for some requests."""

    def answers(self, scope: Scope) -> bool:
        """Returns whether the request is one of these."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None: ...
