"""What the subprocess of an operation reports to its worker: stage, progress and log lines."""

import time
from collections.abc import Callable, Iterable
from typing import Any, Final

from map3d.messages import Message, message

STARTING: Final = Message("starting")
EVERY_S: Final = 0.2
"""Shortest time between two reports of progress."""


class OperationReport:
    """Collects progress and log lines, and sends them to the worker as {"stage", "done", "total", "lines"}, not more often than EVERY_S."""

    def __init__(self, send: Callable[[Any], None]) -> None:
        self._send, self._sent_s = send, -EVERY_S
        self._stage, self._done, self._total = STARTING, 0, 0
        self._lines: list[Message] = []

    def progress(self, stage: Message, done: int = 0, total: int = 0) -> None:
        """`total`: 0 if it is unknown."""
        is_new = stage != self._stage
        self._stage, self._done, self._total = stage, done, total
        if is_new or time.monotonic() - self._sent_s >= EVERY_S:
            self.flush()

    def log(self, *lines: Message) -> None:
        self._lines.extend(lines)
        if time.monotonic() - self._sent_s >= EVERY_S:
            self.flush()

    def log_counted(self, lines: Iterable[Message], most: int, rest: str) -> None:
        """Logs at most `most` lines, and how many more there are, as a message with the code `rest`."""
        listed = list(lines)
        self.log(*listed[:most])
        if len(listed) > most:
            self.log(message(rest, count=len(listed) - most))

    def flush(self) -> None:
        lines, self._lines = [line.document for line in self._lines], []
        self._sent_s = time.monotonic()
        self._send({"stage": self._stage.document, "done": self._done, "total": self._total, "lines": lines})
