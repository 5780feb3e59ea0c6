"""CPU time of a process and its descendants that still run, from /proc."""

import os
from pathlib import Path


def tree_cpu_s(pid: int) -> float:
    """Returns the user and system time in seconds, in steps of a clock tick."""
    return _cpu_s(pid) + sum(tree_cpu_s(child) for child in _children(pid))


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _children(pid: int) -> list[int]:
    return [int(child) for task in Path(f"/proc/{pid}/task").iterdir() for child in (task / "children").read_text().split()]
