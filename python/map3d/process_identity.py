"""Names of processes that stay unique after the process has ended: they tell whether the process that holds a lease or wrote a draft still runs."""

import hashlib
import os
import socket
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

_STATE, _START = 0, 19
"""Fields of /proc/PID/stat after the command."""
_UNKNOWN: Final = "0"


@dataclass(frozen=True)
class ProcessIdentity:
    """`boot`: hash of the boot id and the PID namespace, within which process ids are comparable; `start`: clock ticks from boot to the start of the
    process, which tells it from a later process with the same id. Both are "0" on systems without /proc."""

    host: str
    boot: str
    pid: int
    start: str

    def __str__(self) -> str:
        return f"{self.host}.{self.boot}.{self.pid}.{self.start}"

    @classmethod
    def parse(cls, text: str) -> Self | None:
        """Reverses `str`; returns None for other text."""
        host, *rest = text.rsplit(".", 3)
        if len(rest) != 3 or not rest[1].isdecimal():
            return None
        return cls(host, rest[0], int(rest[1]), rest[2])

    @classmethod
    def current(cls) -> Self:
        return cls(socket.gethostname(), _boot(), os.getpid(), _stat(os.getpid())[1])

    def has_ended(self) -> bool:
        """Returns False for processes of other hosts, boots or PID namespaces, of which nothing is known."""
        if (self.host, self.boot) != (socket.gethostname(), _boot()):
            return False
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return True
        except PermissionError:
            pass
        state, start = _stat(self.pid)
        return state in "ZX" or start != self.start


def _boot() -> str:
    texts = []
    with suppress(OSError):
        texts = [Path("/proc/sys/kernel/random/boot_id").read_text(), os.readlink("/proc/self/ns/pid")]
    return hashlib.sha256(" ".join(texts).encode()).hexdigest()[:8] if texts else _UNKNOWN


def _stat(pid: int) -> tuple[str, str]:
    """Returns the state and the start time of a process, "0" when they are unknown."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return ("X", _UNKNOWN) if Path("/proc/self/stat").exists() else (_UNKNOWN, _UNKNOWN)
    return fields[_STATE], fields[_START]
