"""The bridge from ASGI to Flask: a2wsgi, whose threads outlive a broken connection.

In a2wsgi, a thread hands each chunk of its response to a queue that a task of the event loop sends. When that task fails or is cancelled,
the queue stays full, and the thread of a response with more chunks than the queue holds waits forever. Here it learns that the task has ended.
"""

import threading
from typing import Any

from a2wsgi import WSGIMiddleware
from a2wsgi.wsgi import WSGIResponder


class FlaskBridge(WSGIMiddleware):
    """ASGI 3 for HTTP."""

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        await _Responder(self.app, self.executor, self.send_queue_size)(scope, receive, send)


class _Responder(WSGIResponder):
    """Answers one request."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._ended = threading.Event()
        self._failure: Exception | None = None

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Raises what `send` raises."""
        try:
            await super().__call__(scope, receive, send)
        except ConnectionAbortedError:
            if self._failure is None:
                raise
        if self._failure is not None:
            raise self._failure

    def send(self, message: Any) -> None:
        """Called by the thread. Raises ConnectionAbortedError for a body that is not sent any more, which ends the response; not for its start,
        since the response would never be closed then."""
        if not self._ended.is_set():
            super().send(message)
        if self._ended.is_set() and message["type"] == "http.response.body":
            raise ConnectionAbortedError("the connection ended before the response")

    async def sender(self, send: Any) -> None:
        try:
            await super().sender(send)
        except Exception as error:
            self._failure = error
        finally:
            self._ended.set()
            while not self.send_queue.empty():  # lets the thread finish the call that waits for room
                self.send_queue.get_nowait()
