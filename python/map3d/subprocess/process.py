"""A child process as its parent sees it: start it, ask it, know why it died."""

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import IO, Any, Final

from map3d.errors import ChildDied, ChildRefused, Corrupt, LimitExceeded
from map3d.subprocess.channel import Channel, Message
from map3d.subprocess.limits import Limits

TAIL_BYTES: Final = 2000
PIPE_BYTES: Final = 1 << 20
_ONE_THREAD: Final = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}


@dataclass(frozen=True)
class Failure:
    """An exception in the child, which lives on: its class name and text."""

    kind: str
    message: str


class Child:
    """One long-lived child. `entry` ("module:function") names what it does: function(setup) → work; work(question, blobs, tell) → (answer, blobs).

    Not for several threads at once. The child dies when the thread that started it ends. Making one raises ChildDied when it is gone at once.
    """

    def __init__(self, entry: str, setup: Mapping[str, Any], *, limits: Limits | None = None, environment: Mapping[str, str] | None = None) -> None:
        self.limits = limits or Limits()
        self._stderr: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed by close()
        child_reads, parent_writes = os.pipe()
        parent_reads, child_writes = os.pipe()
        _widen(child_writes)
        self._channel = Channel(parent_reads, parent_writes)
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "map3d.subprocess", entry, str(child_reads), str(child_writes), str(os.getpid())],
                stdin=subprocess.DEVNULL,
                stdout=self._stderr,
                stderr=self._stderr,
                pass_fds=(child_reads, child_writes),
                start_new_session=True,
                env={**os.environ, **_ONE_THREAD, **(environment or {}), "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)},
            )
        finally:
            os.close(child_reads)
            os.close(child_writes)
        try:
            self._say({"setup": dict(setup), "limits": self.limits.to_json()})
        except ChildDied:
            self.close()
            raise

    @property
    def pid(self) -> int:
        return self._process.pid

    def wait_ready(self, timeout_s: float) -> dict[str, Any]:
        """What the child says when its entry has been called; raises ChildRefused when that fails, ChildDied when it ends or takes longer."""
        message = self._hear(timeout_s)
        if message is None:
            self.kill()
            raise ChildDied(f"child was not ready within {timeout_s:g} s{self._tail()}")
        if "ready" not in message.value:
            self.kill()
            failure = message.value.get("error", {})
            raise ChildRefused(f"child could not start: {failure.get('kind')}: {failure.get('message')}")
        ready: dict[str, Any] = message.value["ready"]
        return ready

    def ask(
        self, question: Mapping[str, Any], *, wall_s: float | None, every_s: float = 1.0, meanwhile: Callable[[Any], None] | None = None
    ) -> Message | Failure:
        """The child's answer, or the exception that it met.

        `meanwhile` is called every `every_s` seconds with None, and with whatever the child tells on the way; when it raises, the child is killed
        and the exception goes on. Raises ChildDied when the child ends, hangs beyond `wall_s` or talks nonsense, LimitExceeded when a limit ended it.
        """
        self._say({"question": dict(question)})
        end = None if wall_s is None else time.monotonic() + wall_s
        try:
            while True:
                left = every_s if end is None else min(every_s, max(end - time.monotonic(), 0.0))
                message = self._hear(left)
                if message is None and end is not None and time.monotonic() >= end:
                    raise ChildDied(f"child gave no answer within {wall_s:g} s of wall time")
                if message is None or "told" in message.value:
                    if meanwhile is not None:
                        meanwhile(None if message is None else message.value["told"])
                elif "error" in message.value:
                    return Failure(str(message.value["error"].get("kind")), str(message.value["error"].get("message")))
                else:
                    return Message(message.value["answer"], message.blobs)
        except BaseException:
            self.kill()
            raise

    def kill(self) -> None:
        """Ends the child at once, whatever it does."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Ends the child and frees everything; it may be called twice."""
        self.kill()
        self._channel.close()
        self._stderr.close()

    def _say(self, value: dict[str, Any]) -> None:
        try:
            self._channel.send(value)
        except BrokenPipeError as error:
            raise self._obituary() from error

    def _hear(self, timeout_s: float) -> Message | None:
        try:
            message = self._channel.receive(timeout_s)
        except EOFError as error:
            raise self._obituary() from error
        except Corrupt as error:
            self.kill()
            raise ChildDied(f"child sent a {error}") from error
        if message is not None and not {"ready", "told", "error", "answer"} & set(message.value):
            self.kill()
            raise ChildDied("child sent a message without meaning")
        return message

    def _obituary(self) -> ChildDied | LimitExceeded:
        try:
            status = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self.kill()
            return ChildDied("child closed its pipe and went on; it was killed")
        tail = self._tail()
        if status == -signal.SIGXCPU:
            return LimitExceeded(f"child used up its {self.limits.cpu_s} s of processor time")
        if self.limits.address_space_bytes is not None and ("memory allocation of" in tail or "MemoryError" in tail):
            return LimitExceeded(f"child met its limit of {self.limits.address_space_bytes >> 20} MiB of address space{tail}")
        how = f"ended by {_signal_name(-status)}" if status < 0 else f"ended with exit status {status}"
        return ChildDied(f"child {how} without an answer{tail}")

    def _tail(self) -> str:
        """The last line that the child wrote to its error output, if any."""
        size = self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(size - TAIL_BYTES, 0))
        lines = self._stderr.read().decode("utf-8", "replace").strip().splitlines()
        return f": {lines[-1].strip()}" if lines else ""


def _widen(pipe: int) -> None:
    """Blocks are some megabytes: fewer, larger reads. Where the system does not allow it, nothing is lost but speed."""
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        with contextlib.suppress(OSError):
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
