"""Limits that a subprocess sets on itself before it opens user data: memory, CPU time, open files, network."""

import ctypes
import math
import os
import resource
import signal
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Self

_PR_SET_PDEATHSIG: Final = 1
_CLONE_NEWUSER: Final = 0x10000000
_CLONE_NEWNET: Final = 0x40000000


@dataclass(frozen=True)
class Limits:
    """None means unlimited. `wall_s` and `cpu_s` apply to each request. The parent enforces `wall_s`; the kernel enforces the others.

    `data_bytes` limits the memory that the process allocates; unlike `address_space_bytes`, it does not count mapped files.
    """

    address_space_bytes: int | None = None
    data_bytes: int | None = None
    cpu_s: int | None = None
    wall_s: float | None = None
    open_files: int | None = None
    network: bool = True

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, value: Mapping[str, Any]) -> Self:
        return cls(**value)

    def apply(self) -> dict[str, Any]:
        """Sets the limits of this process, irrevocably. Returns {"network": "cut" | "open"}: "open" where the system does not allow cutting it."""
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        cut = not self.network and _cut_network()
        limits = ((resource.RLIMIT_AS, self.address_space_bytes), (resource.RLIMIT_DATA, self.data_bytes), (resource.RLIMIT_NOFILE, self.open_files))
        for what, value in limits:
            if value is not None:
                _lower(what, value)
        return {"network": "cut" if cut else "open"}

    def renew(self) -> None:
        """Allows `cpu_s` of CPU time for the next request."""
        if self.cpu_s is not None:
            used = resource.getrusage(resource.RUSAGE_SELF)
            hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
            granted = math.ceil(used.ru_utime + used.ru_stime) + self.cpu_s
            resource.setrlimit(resource.RLIMIT_CPU, (granted if hard == resource.RLIM_INFINITY else min(granted, hard), hard))


def die_with_parent(parent_pid: int) -> None:
    """Asks the kernel to kill this process when its parent ends (Linux only)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent_pid:
        os._exit(1)


def _lower(what: int, value: int) -> None:
    hard = resource.getrlimit(what)[1]
    allowed = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(what, (allowed, allowed))


def _cut_network() -> bool:
    """Leaves the network namespace: directly as root, else through a user namespace. Returns False where the system allows neither."""
    if sys.platform != "linux":
        return False
    unshare = ctypes.CDLL(None, use_errno=True).unshare
    return bool(unshare(_CLONE_NEWNET) == 0 or unshare(_CLONE_NEWUSER | _CLONE_NEWNET) == 0)
