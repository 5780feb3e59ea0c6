"""Processes that load a scene once and draw tiles on request, so renderers can be timed in turns."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any, Self

from .peers import FrameFields, PeerMissing, PeerRenderer

TilePosition = tuple[int, int]


class RendererPool:
    """A number of processes with a renderer each. Raises PeerMissing if the renderer is not available."""

    def __init__(self, name: str, make: Callable[[], PeerRenderer], processes: int = 1, environment: Mapping[str, str] | None = None) -> None:
        self.name = name
        context = multiprocessing.get_context("spawn")
        self._channels: list[Connection] = []
        self._processes = []
        with _with_environment(environment or {}):
            for _ in range(processes):
                ours, theirs = context.Pipe()
                process = context.Process(target=_run_renderer, args=(make, theirs), daemon=False)
                process.start()
                theirs.close()
                self._channels.append(ours)
                self._processes.append(process)
        failures = [failure for failure in (self._receive(channel) for channel in self._channels) if failure]
        if failures:
            self.close()
            raise PeerMissing(failures[0])

    def time_draws(self, frame: FrameFields, places: Sequence[TilePosition]) -> float:
        """Returns the wall time to draw all tiles, evenly distributed over the processes."""
        shares = [places[k :: len(self._channels)] for k in range(len(self._channels))]
        begun = time.perf_counter()
        for channel, share in zip(self._channels, shares, strict=True):
            channel.send(("draw", [(frame, *place) for place in share], False))
        for channel in self._channels:
            self._receive(channel)
        return time.perf_counter() - begun

    def call(self, method: str, *arguments: object) -> Any:
        """Calls a method of the first process's renderer."""
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
            raise SystemExit(f"bench: a process of {self.name} exited; see its message above") from None


def _run_renderer(make: Callable[[], PeerRenderer], channel: Connection) -> None:
    """Runs requests until the other end closes the channel. An exception ends the process with a traceback."""
    try:
        renderer = make()
    except PeerMissing as missing:
        channel.send(str(missing))
        return
    channel.send(None)
    while True:
        try:
            method, calls, wanted = channel.recv()
        except EOFError:
            return
        answers = [getattr(renderer, method)(*call) for call in calls]
        channel.send(answers if wanted else None)


@contextmanager
def _with_environment(more: Mapping[str, str]) -> Iterator[None]:
    """Sets environment variables for processes that start in this context."""
    before = dict(os.environ)
    os.environ.update(more)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
