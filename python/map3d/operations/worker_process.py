"""The operation worker that a server starts beside its web processes."""

import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from map3d.process_identity import ProcessIdentity

PAUSES_S: Final = (1.0, 60.0)
"""First and longest pause before a worker that ended by itself is started again; a worker that ran for the longest pause counts as sound."""
END_S: Final = 10.0
"""Time to release the current operation."""


def write_identity(path: Path) -> None:
    """Called by the worker process: says in a file which process it is."""
    draft = path.with_name(f"{path.name}.new")
    draft.write_text(str(ProcessIdentity.current()))
    draft.replace(path)


def is_worker_alive(path: Path) -> bool:
    """Whether the worker process that wrote the file still runs. Any process of this host may ask."""
    try:
        worker = ProcessIdentity.parse(path.read_text())
    except OSError:
        return False
    return worker is not None and not worker.has_ended()


class WorkerProcess:
    """A context in which a worker process runs; when it ends by itself, another one is started after a pause. It ends with the thread that made it,
    also when that is killed. Its operation is released for the next worker. `identity_path`: file for `is_worker_alive`."""

    def __init__(self, workspace: Path) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="map3d-worker-")
        self.identity_path = Path(self._folder.name) / "worker"
        self._command = [sys.executable, "-P", "-m", "map3d.operations", str(workspace.absolute()), str(self.identity_path)]
        self._ending = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._supervise, name="operation worker", daemon=True)

    @property
    def pid(self) -> int | None:
        return None if self._process is None else self._process.pid

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._ending.set()
        self._thread.join(2 * END_S)
        self._folder.cleanup()

    def _supervise(self) -> None:
        """Runs in the thread whose end is the worker's end."""
        pause_s = PAUSES_S[0]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        while not self._ending.is_set():
            started_s = time.monotonic()
            self._process = subprocess.Popen([*self._command, str(os.getpid())], stdin=subprocess.DEVNULL, env=environment, start_new_session=True)
            while self._process.poll() is None and not self._ending.wait(0.2):
                pass
            if self._process.poll() is None:
                self._end(self._process)
                return
            pause_s = PAUSES_S[0] if time.monotonic() - started_s > PAUSES_S[1] else pause_s
            sys.stderr.write(f"map3d: the operation worker ended with status {self._process.returncode}; starting it again in {pause_s:.0f} s\n")
            self._ending.wait(pause_s)
            pause_s = min(2 * pause_s, PAUSES_S[1])

    def _end(self, process: "subprocess.Popen[bytes]") -> None:
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
