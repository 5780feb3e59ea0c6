"""Whether the server can do its work: what each part answers."""

import os
import tempfile
from collections.abc import Callable
from typing import Final

from map3d.catalogue import RenderingRecord
from map3d.errors import Map3dError, StoreError
from map3d.object_store import open_object_store
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.track_stores import tiles_url
from map3d.web.http.shared_catalogue import SharedCatalogue

MAX_STORES: Final = 8
"""Places of tiles outside the workspace that a check of readiness looks at."""

Check = Callable[[], str]
"""Returns "ok" or what is wrong; may wait."""


def readiness_checks(catalogue: SharedCatalogue, *, writes: bool) -> dict[str, Check]:
    """Returns part → its check: workspace, catalogue, stores. `writes`: whether this server writes, and so needs free space."""
    return {
        "workspace": lambda: _state(lambda: _check_workspace(catalogue, writes)),
        "catalogue": lambda: _state(lambda: _check_catalogue(catalogue)),
        "stores": lambda: _state(lambda: _check_stores(catalogue().renderings())),
    }


def _state(check: Callable[[], None]) -> str:
    try:
        check()
    except (Map3dError, OSError) as error:
        return type(error).__name__
    return "ok"


def _check_workspace(catalogue: SharedCatalogue, writes: bool) -> None:
    root = catalogue.workspace.root
    if not os.access(root, os.R_OK | os.X_OK):
        raise StoreError(f"{root}: not readable")
    if writes:
        with tempfile.TemporaryFile(dir=root) as file:
            file.write(b"\0" * 4096)
            file.flush()


def _check_catalogue(catalogue: SharedCatalogue) -> None:
    """Reads, and asks for the database clock, which has no side effect. An open catalogue file stays readable after it was removed, so its path is
    looked at, too."""
    workspace = catalogue.workspace
    if not workspace.root.is_dir() or (workspace.find_catalogue_url() is None and not workspace.catalogue_path.is_file()):
        raise StoreError(f"{workspace.root}: the workspace is gone")
    catalogue().renderings()
    catalogue().clock_s()


def _check_stores(records: list[RenderingRecord]) -> None:
    urls = sorted({url for record in records if (url := tiles_url(record)) is not None})
    for url in urls[:MAX_STORES]:
        open_object_store(url).exists(FILE_NAME)
