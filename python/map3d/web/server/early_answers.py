"""Answers requests from memory in the thread in which granian receives them.

granian hands each request over to the event loop, and the event loop its answer back. These two changes of threads, and a task between them, take
longer than everything else about a tile that is in memory (docs/benchmarks.md). granian has no public hook before the event loop, hence the private
name here; without it, all requests pass the event loop.
"""

import logging
from asyncio import AbstractEventLoop
from collections.abc import Callable
from typing import Any, Final

from granian import _futures

from map3d.web.http.asgi import Messages, Scope

HOOK: Final = "_cbsched_aioschedule"
Schedule = Callable[[Any], None]
"""Takes a request: `scope`, `proto` with the function `send`, `done`."""

log: Final = logging.getLogger("map3d.web")


def answer_early(find_answer: Callable[[Scope], Messages | None]) -> None:
    """Makes the server that granian starts next in this process ask `find_answer` first; it hands requests without an answer to the event loop.

    Threads other than the event loop's call `find_answer`. It does no I/O that may wait, since all requests of the process pass it.
    """
    make_schedule: Callable[..., Schedule] | None = getattr(_futures, HOOK, None)
    if make_schedule is None:
        log.warning("this version of granian has no %s; tiles in memory are answered more slowly", HOOK)
        return

    def make_early(loop: AbstractEventLoop, context: Any, callback: Any) -> Schedule:
        schedule = make_schedule(loop, context, callback)

        def answer_or_schedule(request: Any) -> None:
            answer = find_answer(request.scope) if request.scope["type"] == "http" else None
            if answer is None:
                schedule(request)
                return
            for message in answer:
                request.proto.send(message)
            request.done()

        return answer_or_schedule

    setattr(_futures, HOOK, make_early)
