"""Limits that a child puts on itself before it touches anything of a user's: memory, processor, files, network."""

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
    """None: unlimited. `wall_s` and `cpu_s` are for each question; `wall_s` is watched by the parent, the rest by the kernel."""

    address_space_bytes: int | None = None
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
        """Limits this process for good; returns what could be done: {"network": "cut" | "open"}."""
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        cut = not self.network and _cut_network()
        for what, value in ((resource.RLIMIT_AS, self.address_space_bytes), (resource.RLIMIT_NOFILE, self.open_files)):
            if value is not None:
                _lower(what, value)
        return {"network": "cut" if cut else "open"}

    def renew(self) -> None:
        """Grants `cpu_s` of processor time from now on, for the next question."""
        if self.cpu_s is not None:
            used = resource.getrusage(resource.RUSAGE_SELF)
            hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
            granted = math.ceil(used.ru_utime + used.ru_stime) + self.cpu_s
            resource.setrlimit(resource.RLIMIT_CPU, (granted if hard == resource.RLIM_INFINITY else min(granted, hard), hard))


def die_with_parent(parent_pid: int) -> None:
    """The kernel kills this process when its parent ends, however that ends (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent_pid:
        os._exit(1)


def _lower(what: int, value: int) -> None:
    hard = resource.getrlimit(what)[1]
    allowed = value if hard == resource.RLIM_INFINITY else min(value, hard)
    resource.setrlimit(what, (allowed, allowed))


def _cut_network() -> bool:
    """Leaves the network's namespace, as root at once, else through a user namespace; False where the system allows neither."""
    if sys.platform != "linux":
        return False
    unshare = ctypes.CDLL(None, use_errno=True).unshare
    return bool(unshare(_CLONE_NEWNET) == 0 or unshare(_CLONE_NEWUSER | _CLONE_NEWNET) == 0)
