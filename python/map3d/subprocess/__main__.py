"""`python -m map3d.subprocess ENTRY READ_FD WRITE_FD PARENT_PID`: the child's side. Started by map3d.subprocess.Child and nothing else."""

import importlib
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

from map3d.subprocess.channel import Channel
from map3d.subprocess.handler import Work
from map3d.subprocess.limits import Limits, die_with_parent


def main() -> None:
    entry, read_fd, write_fd, parent_pid = sys.argv[1:5]
    die_with_parent(int(parent_pid))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    channel = Channel(int(read_fd), int(write_fd))
    try:
        _serve(channel, entry)
    except (EOFError, BrokenPipeError):
        os._exit(0)


def _serve(channel: Channel, entry: str) -> None:
    first = channel.receive()
    assert first is not None, "receive without a time limit always has a message"
    try:
        limits = Limits.from_json(first.value["limits"])
        applied = limits.apply()
        work = _load(entry)(first.value["setup"])
    except Exception as error:
        channel.send(_error(error))
        raise
    channel.send({"ready": applied})
    while True:
        asked = channel.receive()
        assert asked is not None, "receive without a time limit always has a message"
        limits.renew()
        try:
            answer, blobs = work(asked.value["question"], asked.blobs, lambda told: channel.send({"told": told}))
        except MemoryError:
            raise
        except Exception as error:
            channel.send(_error(error))
        else:
            channel.send({"answer": answer}, blobs)


def _load(entry: str) -> Callable[[dict[str, Any]], Work]:
    module, _, name = entry.partition(":")
    function: Callable[[dict[str, Any]], Work] = getattr(importlib.import_module(module), name)
    return function


def _error(error: Exception) -> dict[str, Any]:
    return {"error": {"kind": type(error).__name__, "message": str(error) or type(error).__name__}}


if __name__ == "__main__":
    main()
