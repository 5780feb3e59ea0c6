"""The parent's side of a subprocess: starts it, sends requests, and explains why it ended."""

import contextlib
import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any, Final

from map3d import messages
from map3d.errors import Corrupt, LimitExceeded, SubprocessDied, SubprocessStartFailed, SubprocessTimedOut
from map3d.messages import load_message, message
from map3d.subprocess.channel import Channel, Message
from map3d.subprocess.limits import Limits

TAIL_BYTES: Final = 2000
PIPE_BYTES: Final = 1 << 20
_OUT_OF_MEMORY: Final = ("memory allocation of", "MemoryError", "Cannot allocate memory")
"""What a process prints when an allocation or the start of a thread fails."""
_ONE_THREAD: Final = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MALLOC_ARENA_MAX": "2"}


@dataclass(frozen=True)
class Failure:
    """An exception that the subprocess raised and survived: its class name and message."""

    kind: str
    message: messages.Message


class Subprocess:
    """A long-lived subprocess. `entry` ("module:function") names the function that takes `setup` and returns a `Handler`.

    Not thread-safe. The subprocess dies when the thread that started it ends. The constructor raises SubprocessDied when it ends at once.
    """

    def __init__(self, entry: str, setup: Mapping[str, Any], *, limits: Limits | None = None, environment: Mapping[str, str] | None = None) -> None:
        self.limits = limits or Limits()
        self._was_killed = False
        self._stderr: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 - closed by close()
        child_reads, parent_writes = os.pipe()
        parent_reads, child_writes = os.pipe()
        _enlarge(child_writes)
        _enlarge(parent_writes)
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
            self._send({"setup": dict(setup), "limits": self.limits.to_json()})
        except SubprocessDied:
            self.close()
            raise

    @property
    def pid(self) -> int:
        return self._process.pid

    def wait_ready(self, timeout_s: float) -> dict[str, Any]:
        """Waits until the entry function has returned; returns what `Limits.apply` returned in the subprocess.

        Raises SubprocessStartFailed when the function raises, SubprocessDied when the subprocess ends, SubprocessTimedOut.
        """
        answer = self._receive(timeout_s)
        if answer is None:
            self.kill()
            raise SubprocessTimedOut(f"the subprocess was not ready within {timeout_s:g} s: {self._last_output()}".removesuffix(": "))
        if "ready" not in answer.value:
            self.kill()
            failure = answer.value.get("error", {})
            raise SubprocessStartFailed(f"the subprocess could not start: {failure.get('kind')}: {load_message(failure.get('message'))}")
        ready: dict[str, Any] = answer.value["ready"]
        return ready

    def request(
        self,
        value: Mapping[str, Any] | Message,
        *,
        wall_s: float | None,
        every_s: float = 1.0,
        on_progress: Callable[[Any], None] | None = None,
    ) -> Message | Failure:
        """Sends a request, with byte strings if it is a `Message`, and waits for the response, or for the exception that the handler raised.

        Calls `on_progress` with each progress report, and with None at least every `every_s` seconds. When it raises, the subprocess is killed and
        the exception propagates. Raises SubprocessDied when the subprocess ends or sends an invalid message, SubprocessTimedOut after `wall_s`,
        LimitExceeded when a limit ended it.
        """
        request = value if isinstance(value, Message) else Message(dict(value), [])
        end = None if wall_s is None else time.monotonic() + wall_s

        def on_wait() -> None:
            if end is not None and time.monotonic() >= end:
                raise SubprocessTimedOut(f"the subprocess did not read its request within {wall_s:g} s")
            if on_progress is not None:
                on_progress(None)

        try:
            self._send({"request": request.value}, request.blobs, every_s=every_s, on_wait=on_wait)
            while True:
                wait_s = every_s if end is None else min(every_s, max(end - time.monotonic(), 0.0))
                answer = self._receive(wait_s)
                if answer is None and end is not None and time.monotonic() >= end:
                    raise SubprocessTimedOut(message("subprocess-timed-out", seconds=wall_s))
                if answer is None or "progress" in answer.value:
                    if on_progress is not None:
                        on_progress(None if answer is None else answer.value["progress"])
                elif "error" in answer.value:
                    return Failure(str(answer.value["error"].get("kind")), load_message(answer.value["error"].get("message")))
                else:
                    return Message(answer.value["response"], answer.blobs)
        except BaseException:
            self.kill()
            raise

    @property
    def ended_by(self) -> str | None:
        """The name of the signal that ended the subprocess by itself; None while it runs, after an exit, and after `kill`."""
        return None if self._was_killed or (self._process.returncode or 0) >= 0 else _signal_name(-self._process.returncode)

    def output_tail(self, lines: int = 20) -> list[str]:
        """Returns the last lines that the subprocess printed."""
        size = self._stderr.seek(0, os.SEEK_END)
        self._stderr.seek(max(size - TAIL_BYTES, 0))
        return self._stderr.read().decode("utf-8", "replace").strip().splitlines()[-lines:]

    def kill(self) -> None:
        """Ends the subprocess at once."""
        self._was_killed = self._was_killed or self._process.poll() is None
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Ends the subprocess and frees its resources; may be called twice."""
        self.kill()
        self._channel.close()
        self._stderr.close()

    def _send(
        self, value: dict[str, Any], blobs: Sequence[bytes] = (), *, every_s: float | None = None, on_wait: Callable[[], None] | None = None
    ) -> None:
        try:
            self._channel.send(value, blobs, every_s=every_s, on_wait=on_wait)
        except BrokenPipeError as error:
            raise self._exit_error() from error

    def _receive(self, timeout_s: float) -> Message | None:
        try:
            received = self._channel.receive(timeout_s)
        except EOFError as error:
            raise self._exit_error() from error
        except Corrupt as error:
            self.kill()
            raise SubprocessDied(f"the subprocess was killed: {error}") from error
        if received is not None and not {"ready", "progress", "error", "response"} & set(received.value):
            self.kill()
            raise SubprocessDied(f"the subprocess was killed: message of unknown type with keys {sorted(received.value)[:5]}")
        return received

    def _exit_error(self) -> SubprocessDied | LimitExceeded:
        try:
            status = self._process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            self.kill()
            return SubprocessDied("the subprocess was killed: it closed its pipe without ending")
        output = self._last_output()
        if status == -signal.SIGXCPU:
            return LimitExceeded(message("subprocess-over-cpu-limit", seconds=self.limits.cpu_s))
        memory, kind = (self.limits.address_space_bytes, "address space") if self.limits.data_bytes is None else (self.limits.data_bytes, "memory")
        if memory is not None and any(sign in output for sign in _OUT_OF_MEMORY):
            return LimitExceeded(f"the subprocess reached its limit of {memory >> 20} MiB of {kind}: {output}")
        by_signal = status < 0
        how = message("subprocess-ended-by-signal", signal=_signal_name(-status)) if by_signal else message("subprocess-exited", status=status)
        return SubprocessDied(message("about", what=how, message=output) if output else how)

    def _last_output(self) -> str:
        """Returns the last line that the subprocess printed, or an empty string."""
        lines = self.output_tail()
        return lines[-1].strip() if lines else ""


def _enlarge(pipe: int) -> None:
    """Enlarges the pipe's buffer where the system allows it: blocks are some megabytes, and larger reads are faster."""
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        with contextlib.suppress(OSError):
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
