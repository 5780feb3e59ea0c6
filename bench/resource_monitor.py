"""Runs a command and measures time, memory of all its processes, and disk usage."""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

MEMORY_S, DISK_S = 0.2, 20.0


@dataclass
class ResourceUsage:
    """Resource usage of a command and its child processes.

    `memory_bytes`: maximum over time of the summed peak resident memory (VmHWM, mapped files included); `anonymous_bytes`: maximum of the summed
    anonymous memory. The system can reclaim mapped files.
    """

    wall_s: float = 0.0
    cpu_s: float = 0.0
    memory_bytes: int = 0
    anonymous_bytes: int = 0
    disk_peak_bytes: int = 0
    disk_bytes: int = 0
    runs: int = 0


@dataclass
class ResourceMonitor:
    """Samples a process with its descendants, and a folder, until `ended` is set."""

    process: int
    folder: Path
    memory_bytes: int = 0
    anonymous_bytes: int = 0
    disk_bytes: int = 0
    ended: threading.Event = field(default_factory=threading.Event)

    def run(self) -> None:
        next_disk = 0.0
        while not self.ended.wait(MEMORY_S):
            members = process_tree(self.process)
            self.memory_bytes = max(self.memory_bytes, sum(map(peak_resident, members)))
            self.anonymous_bytes = max(self.anonymous_bytes, sum(read_status_bytes(member, "RssAnon:") for member in members))
            if time.monotonic() >= next_disk:
                self.disk_bytes = max(self.disk_bytes, disk_bytes_of(self.folder))
                next_disk = time.monotonic() + DISK_S


def run_monitored(command: Sequence[str], folder: Path, figures: ResourceUsage) -> int:
    """Runs a command, adds its usage to `figures` and returns its exit status. Forwards SIGINT, then raises KeyboardInterrupt.

    A command that ends between two samples counts with its own peak, which the system reports.
    """
    before, begun = os.times(), time.monotonic()
    process = subprocess.Popen(command, start_new_session=True)
    watch = ResourceMonitor(process.pid, folder)
    thread = threading.Thread(target=watch.run, daemon=True)
    thread.start()
    peak_bytes = 0
    try:
        peak_bytes = _wait(process)
        return process.returncode
    except KeyboardInterrupt:
        os.killpg(process.pid, signal.SIGINT)
        peak_bytes = _wait(process)
        raise
    finally:
        watch.ended.set()
        thread.join()
        after = os.times()
        figures.wall_s += time.monotonic() - begun
        figures.cpu_s += after.children_user + after.children_system - before.children_user - before.children_system
        figures.memory_bytes = max(figures.memory_bytes, watch.memory_bytes, peak_bytes)
        figures.anonymous_bytes = max(figures.anonymous_bytes, watch.anonymous_bytes)
        figures.disk_bytes = disk_bytes_of(folder)
        figures.disk_peak_bytes = max(figures.disk_peak_bytes, watch.disk_bytes, figures.disk_bytes)
        figures.runs += 1


def _wait(process: subprocess.Popen[bytes]) -> int:
    """Waits for the end of a process and returns its peak resident memory in bytes."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_maxrss * 1024


def process_tree(process: int) -> list[int]:
    """Returns a process and its descendants."""
    children: dict[int, list[int]] = {}
    for entry in os.scandir("/proc"):
        if entry.name.isdigit():
            try:
                parent = int(Path(entry.path, "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:
                continue
            children.setdefault(parent, []).append(int(entry.name))
    found = [process]
    for member in found:
        found += children.get(member, ())
    return found


def peak_resident(process: int) -> int:
    """Returns the peak resident memory in bytes; 0 for a process that has exited."""
    return read_status_bytes(process, "VmHWM:")


def read_status_bytes(process: int, what: str) -> int:
    """Returns a line of /proc/PID/status in bytes; 0 for a process that has exited."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) << 10 for line in lines if line.startswith(what)), 0)


def disk_bytes_of(folder: Path) -> int:
    """Returns the disk usage of the files in a folder."""
    total, stack = 0, [str(folder)]
    while stack:
        try:
            entries = list(os.scandir(stack.pop()))
        except OSError:
            continue
        for entry in entries:
            try:
                if entry.is_dir(follow_symlinks=False):
                    stack.append(entry.path)
                else:
                    total += entry.stat(follow_symlinks=False).st_blocks * 512
            except OSError:
                continue
    return total
