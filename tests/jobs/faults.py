"""A child for tests: makes blocks of pseudo-random bytes that depend on block and kind of layer alone, and fails as it is told.

setup["frames"][track]["faults"] is not there in real frames; faults are told by files in the folder MAP3D_TEST_FAULTS: `<x>-<y>` holds the kind.
A file `slow` holds how many seconds each block takes.
"""

import contextlib
import hashlib
import os
import random
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from map3d.subprocess import Tell, Work
from map3d.tiles.naming import tiles_of_block
from map3d.types import BlockId


def open_work(setup: Mapping[str, Any]) -> Work:
    folder = Path(os.environ["MAP3D_TEST_FAULTS"])
    if (folder / "no-start").exists():
        raise RuntimeError("told not to start")

    def work(question: dict[str, Any], _blobs: list[bytes], _tell: Tell) -> tuple[dict[str, Any], list[bytes]]:
        z, x, y = question["block"]
        frame = setup["frames"][question["track"]]
        fault = folder / f"{z}-{x}-{y}"
        if fault.exists():
            fail(fault.read_text())
        slow = folder / "slow"
        if slow.exists():
            time.sleep(float(slow.read_text()))
        tiles = [] if (x + y) % 7 == 6 else list(tiles_of_block(BlockId(z, x, y), frame["zmax"]))
        kinds = [layer["kind"] for layer in frame["layers"]]
        names = [[layer, *tile] for tile in tiles for layer in range(len(kinds))]
        blobs = [hashlib.sha256(f"{kinds[layer]} {tile}".encode()).digest() * 8 for layer, *tile in names]
        seam = [f"seam {z}/{x}/{y}".encode()] if tiles else []
        return {"tiles": names, "seam": bool(seam), "seconds": 0.01}, blobs + seam

    return work


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
    raise ValueError("poison")


def memory() -> None:
    raise MemoryError("told so")


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
    "nonsense": nonsense,
}
