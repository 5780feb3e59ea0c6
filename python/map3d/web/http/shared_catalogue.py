"""The catalogue of a workspace, opened on first use."""

from threading import Lock
from typing import Final

from map3d.catalogue import Catalogue, Workspace
from map3d.errors import StoreError

WAIT_S: Final = 5.0
"""How long a web request waits for the catalogue; a render waits until a database that restarts is back."""


class SharedCatalogue:
    """Threads may share it."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = Lock()
        self._opened: Catalogue | None = None

    def __call__(self) -> Catalogue:
        """Raises NotFound without a workspace, StoreError for a database that cannot be reached."""
        if self._opened is not None:
            return self._opened
        if not self._lock.acquire(timeout=WAIT_S):
            raise StoreError(f"{self.workspace.root}: the catalogue cannot be opened for {WAIT_S:g} s")
        try:
            self._opened = self._opened or self.workspace.open_catalogue(wait_s=WAIT_S)
            return self._opened
        finally:
            self._lock.release()

    def close(self) -> None:
        with self._lock:
            if self._opened is not None:
                self._opened.close()
                self._opened = None
