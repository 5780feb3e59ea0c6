"""A subprocess for tests: makes blocks of pseudo-random bytes that depend only on block and layer kind, and fails on request.

The folder MAP3D_TEST_FAULTS selects the faults: a file `<z>-<x>-<y>` contains the kind of fault of that block, a file `slow` the seconds that each
block takes, a file `no-start` makes the start fail, a file `log` collects the process id of each request, and the bytes of all
blocks depend on the file `salt`.
"""

import contextlib
import hashlib
import os
import random
import resource
import signal
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from map3d.errors import StalePlan
from map3d.subprocess import Handler, ReportProgress
from map3d.tiles.naming import tiles_of_block
from map3d.types import BlockId


def open_faulty(setup: Mapping[str, Any]) -> Handler:
    folder = Path(os.environ["MAP3D_TEST_FAULTS"])
    if (folder / "no-start").exists():
        raise RuntimeError("cannot start")

    def handle(request: dict[str, Any], _blobs: list[bytes], _report: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        z, x, y = request["block"]
        frame = setup["frames"][request["track"]]
        fault = folder / f"{z}-{x}-{y}"
        if fault.exists():
            fail(fault.read_text())
        if (folder / "log").exists():
            with (folder / "log").open("a") as log:
                log.write(f"{os.getpid()}\n")
        slow = folder / "slow"
        if slow.exists():
            time.sleep(float(slow.read_text()))
        tiles = [] if (x + y) % 7 == 6 else list(tiles_of_block(BlockId(z, x, y), frame["zmax"]))
        kinds = [layer["kind"] for layer in frame["layers"]]
        names = [[layer, *tile] for tile in tiles for layer in range(len(kinds))]
        salt = (folder / "salt").read_text() if (folder / "salt").exists() else ""
        blobs = [hashlib.sha256(f"{kinds[layer]} {tile}{salt}".encode()).digest() * 8 for layer, *tile in names]
        seam = [f"seam {z}/{x}/{y}{salt}".encode()] if tiles else []
        return {"tiles": names, "seam": bool(seam), "seconds": 0.01}, blobs + seam

    return handle


def fail(kind: str) -> None:
    FAULTS[kind]()


def segfault() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)
    time.sleep(60)


def killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def spin() -> None:
    while True:
        random.random()


def exception() -> None:
    raise ValueError("faulty block")


def stale() -> None:
    raise StalePlan("the scene has changed since the block was planned")


def memory() -> None:
    """Fills the memory that a limit leaves."""
    resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
    blocks = []
    while True:
        blocks.append(bytearray(64 << 20))


def stack_overflow() -> None:
    """Recurses in C until the stack overflows."""
    nested: list[object] = []
    for _ in range(5_000_000):
        nested = [nested]
    sys.setrecursionlimit(1 << 30)
    repr(nested)


def nonsense() -> None:
    for fd in range(3, 256):
        with contextlib.suppress(OSError):
            os.write(fd, b"\xff" * 64)
    time.sleep(60)


FAULTS = {
    "segfault": segfault,
    "abort": os.abort,
    "killed": killed,
    "hang": lambda: time.sleep(3600),
    "spin": spin,
    "exception": exception,
    "exit 0": lambda: os._exit(0),
    "memory": memory,
    "stack overflow": stack_overflow,
    "stale": stale,
    "nonsense": nonsense,
}
