"""The processes that faults hit: commands of map3d that are killed and started again."""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Final

OUTPUT_BYTES: Final = 4_000
MARK: Final = "MAP3D_FAULTS_RUN"
"""Environment variable by which the descendants of a run's processes are found."""


class Command:
    """A command that can be started again after it has ended. Its output goes to a file, of which `output` is the end."""

    def __init__(self, name: str, arguments: Sequence[object], environment: Mapping[str, str] | None = None, module: str = "map3d") -> None:
        """`module`: the Python module that is run with the arguments."""
        self.name = name
        self._arguments = [sys.executable, "-m", module, *map(str, arguments)]
        self._environment = {**os.environ, "PYTHONUNBUFFERED": "1", **(environment or {})}
        self._process: subprocess.Popen[bytes] | None = None
        self._output: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (closed by `end`)
        self.starts = 0

    def start(self) -> None:
        self._output.truncate(0)
        self._output.seek(0)
        self._process = subprocess.Popen(
            self._arguments, stdin=subprocess.DEVNULL, stdout=self._output, stderr=subprocess.STDOUT, env=self._environment
        )
        self.starts += 1

    @property
    def pid(self) -> int:
        assert self._process is not None, "started"
        return self._process.pid

    def status(self) -> int | None:
        """Returns the exit status; None while the process runs."""
        assert self._process is not None, "started"
        return self._process.poll()

    def is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def wait(self, timeout_s: float) -> int:
        assert self._process is not None, "started"
        return self._process.wait(timeout_s)

    def kill(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.kill()
            self._process.wait()

    def output(self) -> str:
        size = os.fstat(self._output.fileno()).st_size
        return os.pread(self._output.fileno(), OUTPUT_BYTES, max(0, size - OUTPUT_BYTES)).decode(errors="replace")

    def end(self) -> None:
        self.kill()
        self._output.close()


def children_of(parent: int) -> list[int]:
    """Returns the process ids of a process's children."""
    children = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            if int(path.read_text().rpartition(")")[2].split()[1]) == parent:
                children.append(int(path.parent.name))
    return sorted(children)


def kill_child(parent: int, choose: random.Random) -> bool:
    """Kills one child of a process; returns False when it has none."""
    children = children_of(parent)
    if not children:
        return False
    with suppress(ProcessLookupError):
        os.kill(choose.choice(children), signal.SIGKILL)
    return True


def survivors(mark: str, wait_s: float = 20.0) -> list[str]:
    """Returns the command lines of processes with this mark that are still there after `wait_s`."""
    deadline = time.monotonic() + wait_s
    while (found := _marked(f"{MARK}={mark}".encode())) and time.monotonic() < deadline:
        time.sleep(0.05)
    return found


def _marked(entry: bytes) -> list[str]:
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            if entry in (path / "environ").read_bytes().split(b"\0"):
                found.append((path / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip())
    return [command for command in found if command]
