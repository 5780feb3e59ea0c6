"""Processes that hold a scene ready and draw tiles of it when told to, so that renderers can be timed in turns."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Self

from .peers import Drawer, Frame, Missing

Place = tuple[int, int]


class Crew:
    """`processes` of one renderer; each makes its own drawer. Raises Missing when that cannot be had."""

    def __init__(self, name: str, make: Callable[[], Drawer], processes: int = 1, environment: Mapping[str, str] | None = None) -> None:
        self.name = name
        context = multiprocessing.get_context("spawn")
        self._channels: list[Connection] = []
        self._processes = []
        with _environment(environment or {}):
            for _ in range(processes):
                ours, theirs = context.Pipe()
                process = context.Process(target=_serve, args=(make, theirs), daemon=False)
                process.start()
                theirs.close()
                self._channels.append(ours)
                self._processes.append(process)
        failures = [failure for failure in (self._receive(channel) for channel in self._channels) if failure]
        if failures:
            self.close()
            raise Missing(failures[0])

    def seconds(self, frame: Frame, places: Sequence[Place]) -> float:
        """Wall time to draw all places, dealt out evenly."""
        shares = [places[k :: len(self._channels)] for k in range(len(self._channels))]
        begun = time.perf_counter()
        for channel, share in zip(self._channels, shares, strict=True):
            channel.send(("draw", [(frame, *place) for place in share], False))
        for channel in self._channels:
            self._receive(channel)
        return time.perf_counter() - begun

    def ask(self, method: str, *arguments: object) -> Any:
        """Of the first process's drawer."""
        self._channels[0].send((method, [arguments], True))
        return self._receive(self._channels[0])[0]

    def close(self) -> None:
        for channel in self._channels:
            channel.close()
        for process in self._processes:
            process.join(20)
            if process.is_alive():
                process.kill()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _receive(self, channel: Connection) -> Any:
        try:
            return channel.recv()
        except EOFError:
            raise SystemExit(f"bench: a process of {self.name} ended; its message stands above") from None


def _serve(make: Callable[[], Drawer], channel: Connection) -> None:
    """Answers until the other end is closed. A failure ends the process with its traceback."""
    try:
        drawer = make()
    except Missing as missing:
        channel.send(str(missing))
        return
    channel.send(None)
    while True:
        try:
            method, calls, wanted = channel.recv()
        except EOFError:
            return
        answers = [getattr(drawer, method)(*call) for call in calls]
        channel.send(answers if wanted else None)


@contextmanager
def _environment(more: Mapping[str, str]) -> Iterator[None]:
    """What children that start meanwhile see."""
    before = dict(os.environ)
    os.environ.update(more)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
