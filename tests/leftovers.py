"""What a file of tests leaves behind: processes, temporary files and, as warnings, sockets and files that nothing refers to."""

import gc
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

GRACE_S: Final = 10.0
"""A process that has been told to end has this time."""
KEPT: Final = {"dask-scratch-space"}
"""Empty folders that programs of others keep for their next run."""
session_processes: Final = set[int]()
"""Servers that serve all tests of a session."""


@contextmanager
def own_temporary_folder() -> Iterator[Path]:
    """Makes this process and those that it starts write temporary files to a new folder, whose name tells them from those of other sessions."""
    before = os.environ.get("TMPDIR")
    with tempfile.TemporaryDirectory(prefix="map3d-tests-", ignore_cleanup_errors=True) as folder:
        os.environ["TMPDIR"] = tempfile.tempdir = folder
        try:
            yield Path(folder)
        finally:
            tempfile.tempdir = None
            os.environ.pop("TMPDIR")
            if before is not None:
                os.environ["TMPDIR"] = before


@contextmanager
def nothing_is_left(folder: Path) -> Iterator[None]:
    """Fails if the processes that were started inside, or their files in the temporary folder, outlive it.

    Collects garbage at the end, so that a ResourceWarning about a socket, which is an error, names a test of this file.
    """
    processes, files = _processes(folder), _files(folder)
    yield
    for name in ("last_exc", "last_value", "last_traceback", "last_type"):
        # The traceback of a failed test refers to its variables.
        sys.__dict__.pop(name, None)
    gc.collect()
    deadline_s = time.monotonic() + GRACE_S
    while (left := _left(folder, processes, files)) and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert not left, f"the tests of this file left {', '.join(left)}"


def _left(folder: Path, processes: dict[int, str], files: set[str]) -> list[str]:
    running = _processes(folder)
    return [f"process {pid}: {running[pid]}" for pid in running.keys() - processes.keys() - session_processes] + sorted(_files(folder) - files)


def _files(folder: Path) -> set[str]:
    return {str(path) for path in folder.iterdir() if path.name not in KEPT}


def _processes(folder: Path) -> dict[int, str]:
    """Returns the command lines of the other processes that got this temporary folder, also of those whose parent has ended."""
    variable, found = f"TMPDIR={folder}".encode(), dict[int, str]()
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if int(process.name) != os.getpid() and variable in (process / "environ").read_bytes().split(b"\0"):
                command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                if "multiprocessing.resource_tracker" not in command:  # ends with the process that started it
                    found[int(process.name)] = command
        except OSError:  # another user's, or ended
            continue
    return found
