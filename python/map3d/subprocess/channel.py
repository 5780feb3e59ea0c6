"""Messages between a process and its subprocess over pipes: a JSON object and any number of byte strings.

On the wire: u32 length of the JSON text, u64 total length of the byte strings (both little-endian), the JSON text, the byte strings. The JSON lists
the length of each byte string under "blobs".
"""

import json
import os
import select
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from map3d.errors import Corrupt

_HEAD: Final = struct.Struct("<IQ")
MAX_JSON_BYTES: Final = 64 << 20
MAX_BLOBS_BYTES: Final = 4 << 30
_READ_BYTES: Final = 1 << 20


class Message(NamedTuple):
    value: dict[str, Any]
    blobs: list[bytes]


ReportProgress = Callable[[Any], None]
"""Sends a JSON value to the parent while a request is being handled."""

Handler = Callable[[dict[str, Any], list[bytes], ReportProgress], tuple[dict[str, Any], Sequence[bytes]]]
"""(request, its byte strings, report) → (response, its byte strings). The parent receives an exception as a `Failure`; the subprocess lives on."""


class Channel:
    """Sends and receives messages over two pipes. Not thread-safe."""

    def __init__(self, read_fd: int, write_fd: int) -> None:
        """Takes ownership of the two file descriptors."""
        self._read_fd, self._write_fd = read_fd, write_fd
        self._buffer = bytearray()
        if write_fd >= 0:
            os.set_blocking(write_fd, False)

    def send(
        self, value: Mapping[str, Any], blobs: Sequence[bytes] = (), *, every_s: float | None = None, on_wait: Callable[[], None] | None = None
    ) -> None:
        """Blocks until the message is written; calls `on_wait` every `every_s` seconds in which the other side reads nothing, and stops in the middle
        of the message when that raises. Raises BrokenPipeError when the other side has closed its pipe."""
        text = json.dumps({**value, "blobs": [len(blob) for blob in blobs]}, ensure_ascii=False).encode("utf-8", "replace")
        for part in (_HEAD.pack(len(text), sum(map(len, blobs))) + text, *blobs):
            view = memoryview(part)
            while view:
                if select.select([], [self._write_fd], [], every_s)[1]:
                    view = view[os.write(self._write_fd, view) :]
                elif on_wait is not None:
                    on_wait()

    def receive(self, timeout_s: float | None = None) -> Message | None:
        """Returns the next message, None when no message is complete within the time. Raises EOFError when the other side has closed its pipe,
        Corrupt for an invalid message."""
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            message = self._take()
            if message is not None:
                return message
            remaining_s = None if end is None else max(end - time.monotonic(), 0.0)
            if not select.select([self._read_fd], [], [], remaining_s)[0]:
                return None
            data = os.read(self._read_fd, _READ_BYTES)
            if not data:
                raise EOFError("the other side closed the pipe")
            self._buffer += data

    def close(self) -> None:
        for fd in (self._read_fd, self._write_fd):
            if fd >= 0:
                os.close(fd)
        self._read_fd = self._write_fd = -1

    def _take(self) -> Message | None:
        if len(self._buffer) < _HEAD.size:
            return None
        json_bytes, blobs_bytes = _HEAD.unpack_from(self._buffer)
        if json_bytes > MAX_JSON_BYTES or blobs_bytes > MAX_BLOBS_BYTES:
            raise Corrupt(f"message of {json_bytes} + {blobs_bytes} bytes: larger than the limit of {MAX_JSON_BYTES} + {MAX_BLOBS_BYTES}")
        end = _HEAD.size + json_bytes + blobs_bytes
        if len(self._buffer) < end:
            return None
        with memoryview(self._buffer) as whole, whole[_HEAD.size + json_bytes : end] as rest:
            message = _parse(bytes(whole[_HEAD.size : _HEAD.size + json_bytes]), rest)
        del self._buffer[:end]
        return message


def _parse(text: bytes, rest: memoryview) -> Message:
    try:
        value = json.loads(text)
        lengths = value.pop("blobs")
        if sum(lengths) != len(rest) or any(length < 0 for length in lengths):
            raise ValueError(f"byte strings of lengths {lengths} in {len(rest)} bytes")
    except (ValueError, AttributeError, KeyError, TypeError) as error:
        raise Corrupt(f"invalid message: {error}") from error
    blobs, at = [], 0
    for length in lengths:
        blobs.append(bytes(rest[at : at + length]))
        at += length
    return Message(value, blobs)
