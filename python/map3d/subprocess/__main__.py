"""`python -m map3d.subprocess ENTRY READ_FD WRITE_FD PARENT_PID`: the subprocess's side. Only map3d.subprocess.Subprocess starts it."""

import importlib
import os
import signal
import sys
from collections.abc import Callable
from typing import Any

from map3d.errors import Map3dError
from map3d.messages import verbatim
from map3d.subprocess.channel import Channel, Handler
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
    assert first is not None, "receive without a timeout always returns a message"
    try:
        limits = Limits.from_json(first.value["limits"])
        applied = limits.apply()
        handle = _load(entry)(first.value["setup"])
    except Exception as error:
        channel.send(_error(error))
        raise
    channel.send({"ready": applied})
    while True:
        message = channel.receive()
        assert message is not None, "receive without a timeout always returns a message"
        limits.renew()
        try:
            response, blobs = handle(message.value["request"], message.blobs, lambda progress: channel.send({"progress": progress}))
        except MemoryError:
            raise
        except Exception as error:
            channel.send(_error(error))
        else:
            channel.send({"response": response}, blobs)


def _load(entry: str) -> Callable[[dict[str, Any]], Handler]:
    module, _, name = entry.partition(":")
    function: Callable[[dict[str, Any]], Handler] = getattr(importlib.import_module(module), name)
    return function


def _error(error: Exception) -> dict[str, Any]:
    text = verbatim(str(error) or type(error).__name__)
    return {"error": {"kind": type(error).__name__, "message": (error.message if isinstance(error, Map3dError) else text).document}}


if __name__ == "__main__":
    main()
