"""The catalogue of a workspace, opened on first use."""

from threading import Lock

from map3d.catalogue import Catalogue, Workspace


class SharedCatalogue:
    """Threads may share it."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace = workspace
        self._lock = Lock()
        self._opened: Catalogue | None = None

    def __call__(self) -> Catalogue:
        """Raises NotFound without a workspace."""
        with self._lock:
            self._opened = self._opened or self.workspace.open_catalogue()
            return self._opened

    def close(self) -> None:
        with self._lock:
            if self._opened is not None:
                self._opened.close()
                self._opened = None
