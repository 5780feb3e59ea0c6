"""Runs a command and watches what it takes: time, memory of all its processes, room on the disk."""

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
class Figures:
    """`memory_bytes`: the most that the processes alive at one moment had ever resident, summed over them (VmHWM, mapped files included);
    `anonymous_bytes`: the most that they had at one moment without mapped files, which the system takes back when it needs room."""

    wall_s: float = 0.0
    cpu_s: float = 0.0
    memory_bytes: int = 0
    anonymous_bytes: int = 0
    disk_peak_bytes: int = 0
    disk_bytes: int = 0
    runs: int = 0


@dataclass
class Watch:
    """Samples a process with its descendants, and a folder, until told to stop."""

    process: int
    folder: Path
    memory_bytes: int = 0
    anonymous_bytes: int = 0
    disk_bytes: int = 0
    ended: threading.Event = field(default_factory=threading.Event)

    def run(self) -> None:
        next_disk = 0.0
        while not self.ended.wait(MEMORY_S):
            members = family(self.process)
            self.memory_bytes = max(self.memory_bytes, sum(map(high_water, members)))
            self.anonymous_bytes = max(self.anonymous_bytes, sum(resident(member, "RssAnon:") for member in members))
            if time.monotonic() >= next_disk:
                self.disk_bytes = max(self.disk_bytes, used_bytes(self.folder))
                next_disk = time.monotonic() + DISK_S


def watched(command: Sequence[str], folder: Path, figures: Figures) -> int:
    """Runs a command and adds what it took to `figures`; returns its exit status. An interrupt is passed on and raised once it has ended."""
    before, begun = os.times(), time.monotonic()
    process = subprocess.Popen(command, start_new_session=True)
    watch = Watch(process.pid, folder)
    thread = threading.Thread(target=watch.run, daemon=True)
    thread.start()
    try:
        return process.wait()
    except KeyboardInterrupt:
        os.killpg(process.pid, signal.SIGINT)
        process.wait()
        raise
    finally:
        watch.ended.set()
        thread.join()
        after = os.times()
        figures.wall_s += time.monotonic() - begun
        figures.cpu_s += after.children_user + after.children_system - before.children_user - before.children_system
        figures.memory_bytes = max(figures.memory_bytes, watch.memory_bytes)
        figures.anonymous_bytes = max(figures.anonymous_bytes, watch.anonymous_bytes)
        figures.disk_bytes = used_bytes(folder)
        figures.disk_peak_bytes = max(figures.disk_peak_bytes, watch.disk_bytes, figures.disk_bytes)
        figures.runs += 1


def family(process: int) -> list[int]:
    """A process, its children, and theirs."""
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


def high_water(process: int) -> int:
    """VmHWM in bytes; 0 of a process that has ended."""
    return resident(process, "VmHWM:")


def resident(process: int, what: str) -> int:
    """A line of /proc/…/status in bytes; 0 of a process that has ended."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) << 10 for line in lines if line.startswith(what)), 0)


def used_bytes(folder: Path) -> int:
    """What the files below a folder take on the disk."""
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
