"""The children that parse. One is kept for as long as files need the same limits, so that thousands of small files do not start thousands of
processes; after any failure a new one starts."""

from types import TracebackType
from typing import Any, Final, Self

from map3d.subprocess import Limits, Subprocess

START_S: Final = 120.0
_ENVIRONMENT: Final = {"RAYON_NUM_THREADS": "1"}


class Parsers:
    """Entered by every import that uses it and by its owner; the outermost `with` ends the child."""

    def __init__(self) -> None:
        self._child: Subprocess | None = None
        self._for: tuple[str, Limits] | None = None
        self._applied: dict[str, Any] = {}
        self._depth = 0

    def get(self, entry: str, limits: Limits) -> tuple[Subprocess, dict[str, Any]]:
        """A ready child, and what it could limit. Raises SubprocessDied."""
        if self._child is None or self._for != (entry, limits):
            self.drop()
            self._child, self._for = Subprocess(entry, {}, limits=limits, environment=_ENVIRONMENT), (entry, limits)
            self._applied = self._child.wait_ready(START_S)
        return self._child, self._applied

    def drop(self) -> None:
        """Ends the child, if there is one."""
        if self._child is not None:
            self._child.close()
        self._child = self._for = None

    def __enter__(self) -> Self:
        self._depth += 1
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.drop()
