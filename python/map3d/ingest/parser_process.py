"""The subprocess that parses source documents, reused as long as the limits stay the same."""

from types import TracebackType
from typing import Any, Final, Self

from map3d.subprocess import Limits, Subprocess

START_TIMEOUT_S: Final = 120.0
_ENVIRONMENT: Final = {"RAYON_NUM_THREADS": "1"}


class ParserProcess:
    """Keeps one subprocess, so that thousands of small files do not start thousands of processes. After a failure the next file starts a new one.

    Nestable context manager: the outermost `with` ends the subprocess.
    """

    def __init__(self) -> None:
        self._subprocess: Subprocess | None = None
        self._started_with: tuple[str, Limits] | None = None
        self._applied: dict[str, Any] = {}
        self._depth = 0

    def get(self, entry: str, limits: Limits) -> tuple[Subprocess, dict[str, Any]]:
        """Returns a ready subprocess and the limits that the system could apply. Raises SubprocessDied."""
        if self._subprocess is None or self._started_with != (entry, limits):
            self.stop()
            self._subprocess, self._started_with = Subprocess(entry, {}, limits=limits, environment=_ENVIRONMENT), (entry, limits)
            self._applied = self._subprocess.wait_ready(START_TIMEOUT_S)
        return self._subprocess, self._applied

    def stop(self) -> None:
        """Ends the subprocess, if one runs."""
        if self._subprocess is not None:
            self._subprocess.close()
        self._subprocess = self._started_with = None

    def __enter__(self) -> Self:
        self._depth += 1
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.stop()
