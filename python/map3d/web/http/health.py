"""Whether the server can do its work: alive (it answers and its workspace is there), ready (it can also read and write what requests need)."""

import os
import tempfile
from collections.abc import Callable
from typing import Final

from map3d.catalogue import Catalogue, RenderingRecord, Workspace
from map3d.errors import Map3dError, StoreError
from map3d.object_store import open_object_store
from map3d.tiles.manifest import FILE_NAME
from map3d.tiles.track_stores import tiles_url

MAX_STORES: Final = 8
"""Places of tiles outside the workspace that a check of readiness looks at."""


def check_alive(workspace: Workspace, catalogue: Catalogue) -> None:
    """Raises StoreError when the workspace is gone or the catalogue cannot be read. An open catalogue file stays readable after its folder was
    removed, so the path is looked at, too."""
    if not workspace.root.is_dir() or (workspace.find_catalogue_url() is None and not workspace.catalogue_path.is_file()):
        raise StoreError(f"{workspace.root}: the workspace is gone")
    catalogue.renderings()


def check_ready(workspace: Workspace, catalogue: Catalogue, *, writes: bool) -> dict[str, str]:
    """Returns part → "ok" or what is wrong with it: workspace, catalogue, stores. `writes`: whether this server writes, and so needs free space."""
    return {
        "workspace": _try(lambda: _check_workspace(workspace, writes)),
        "catalogue": _try(lambda: _check_catalogue(workspace, catalogue)),
        "stores": _try(lambda: _check_stores(catalogue.renderings())),
    }


def _try(check: Callable[[], None]) -> str:
    try:
        check()
    except (Map3dError, OSError) as error:
        return type(error).__name__
    return "ok"


def _check_workspace(workspace: Workspace, writes: bool) -> None:
    if not os.access(workspace.root, os.R_OK | os.X_OK):
        raise StoreError(f"{workspace.root}: not readable")
    if writes:
        with tempfile.TemporaryFile(dir=workspace.root) as file:
            file.write(b"\0" * 4096)
            file.flush()


def _check_catalogue(workspace: Workspace, catalogue: Catalogue) -> None:
    """Reading the database clock uses the same connection as requests and has no side effect."""
    check_alive(workspace, catalogue)
    catalogue.clock_s()


def _check_stores(records: list[RenderingRecord]) -> None:
    urls = sorted({url for record in records if (url := tiles_url(record)) is not None})
    for url in urls[:MAX_STORES]:
        open_object_store(url).exists(FILE_NAME)
