"""The folders that a workspace publishes to: `published/NAME`. They are listed and removed by rendering."""

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from map3d.catalogue import Workspace
from map3d.errors import BadRequest, Map3dError, NotFound
from map3d.ingest.asset_removal import remove_folder
from map3d.lifecycle.removal_checks import folder_bytes
from map3d.publish.folder_target import draft_of, old_of
from map3d.requests.publications import FOLDER_NAME
from map3d.tiles.manifest import FILE_NAME, Manifest

FOLDER: Final = "published"


@dataclass(frozen=True)
class PublishedFolder:
    """`name`: of the folder; `rendering`: whose manifest it holds; `bytes`: of all its files."""

    name: str
    rendering: str
    bytes: int


def published_path(workspace: Workspace, folder: str) -> Path:
    """Returns the place of a published folder. Raises BadRequest for other names than `FOLDER_NAME`."""
    if not re.fullmatch(FOLDER_NAME, folder, re.ASCII):
        raise BadRequest(f"folder {folder[:80]!r}: use 1 to 64 lower-case letters, digits, - and _; the first is a letter or digit")
    return workspace.root / FOLDER / folder


def published_folders(workspace: Workspace, rendering: str) -> list[PublishedFolder]:
    """Returns the folders that hold a rendering, by name. Leaves out links and what cannot be read."""
    return [PublishedFolder(path.name, rendering, folder_bytes(path)) for path in _folders(workspace) if _rendering_in(path) == rendering]


def find_published(workspace: Workspace, rendering: str, folder: str) -> PublishedFolder:
    """Returns a published folder. Raises BadRequest for a wrong name and for another rendering's folder, NotFound."""
    path = published_path(workspace, folder)
    if path.is_symlink() or not path.is_dir():
        raise NotFound(f"rendering {rendering}: no published folder {folder}")
    found = _rendering_in(path)
    if found != rendering:
        raise BadRequest(f"folder {folder}: holds {'no rendering' if found is None else f'rendering {found}'}, not {rendering}; nothing was removed")
    return PublishedFolder(folder, rendering, folder_bytes(path))


def remove_published(workspace: Workspace, rendering: str, folder: str) -> int:
    """Removes a published folder with the drafts of publications that were stopped, and returns its bytes.

    The folder first gets a hidden name in one step, so that no web server serves a part of it. After a kill, the same call completes the removal.
    Raises BadRequest, NotFound, StoreError.
    """
    path = published_path(workspace, folder)
    leaving = path.with_name(f".{folder}.removing")
    size = folder_bytes(leaving)
    if os.path.lexists(path) or not leaving.is_dir():
        size += find_published(workspace, rendering, folder).bytes
        remove_folder(leaving)
        path.rename(leaving)
    for one in (leaving, draft_of(path), old_of(path)):
        remove_folder(one)
    return size


def folders_of(workspace: Workspace, renderings: Sequence[str]) -> list[PublishedFolder]:
    """Returns the published folders that hold one of the renderings, by rendering and name."""
    return [folder for rendering in renderings for folder in published_folders(workspace, rendering)]


def remove_with_renderings(workspace: Workspace, renderings: Sequence[str], folders: Sequence[str]) -> int:
    """Removes published folders of renderings that are about to go, and returns their bytes. Folders that are gone already count as removed.

    Raises BadRequest for a folder that holds something else, StoreError.
    """
    total = 0
    for folder in folders if renderings else ():
        held = _rendering_in(published_path(workspace, folder))
        with suppress(NotFound):
            total += remove_published(workspace, held if held is not None and held in renderings else renderings[0], folder)
    return total


def _folders(workspace: Workspace) -> Iterator[Path]:
    root = workspace.root / FOLDER
    names = sorted(os.listdir(root)) if root.is_dir() else []
    for path in (root / name for name in names if re.fullmatch(FOLDER_NAME, name, re.ASCII)):
        if path.is_dir() and not path.is_symlink():
            yield path


def _rendering_in(folder: Path) -> str | None:
    """Returns the rendering whose manifest a folder holds; None if there is no readable one."""
    manifest = folder / FILE_NAME
    try:
        return Manifest.load(manifest.read_bytes(), str(manifest)).name
    except (OSError, Map3dError):
        return None
