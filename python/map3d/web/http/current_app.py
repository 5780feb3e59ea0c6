"""The workspace and the catalogue of the current app."""

from threading import Lock
from typing import Final

from flask import current_app

from map3d.catalogue import Catalogue, Workspace

_open_lock: Final = Lock()


def workspace() -> Workspace:
    home: Workspace = current_app.config["WORKSPACE"]
    return home


def catalogue() -> Catalogue:
    """Returns the catalogue of the current app, opened on first use."""
    with _open_lock:
        opened: Catalogue | None = current_app.extensions.get("map3d.catalogue")
        if opened is None:
            opened = current_app.extensions["map3d.catalogue"] = workspace().open_catalogue()
    return opened


def close() -> None:
    """Closes the catalogue of the current app."""
    opened: Catalogue | None = current_app.extensions.pop("map3d.catalogue", None)
    if opened is not None:
        opened.close()
