"""Removes assets from a scene. A removal that was killed is completed by the next removal, import or build.

While a removal lasts, the file `assets/.removing` lists the assets and their files. Whatever the killed removal had reached, doing all steps again
completes it. The file `removed-assets.json` keeps which file each removed asset was of: a file that returns has its name, and with it its ids, back.
"""

import json
import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from map3d.catalogue import Catalogue, Workspace
from map3d.errors import NotFound, StoreError
from map3d.ingest.import_checkpoints import remove_checkpoints
from map3d.registry import Registry

_MARK: Final = ".removing"
_REMOVED: Final = "removed-assets.json"


def remove_assets(workspace: Workspace, catalogue: Catalogue, scene: str, names: Sequence[str]) -> None:
    """Removes records, objects and folders of assets; the built files follow with the next build. The caller holds the scene's lock and has finished
    killed imports and removals."""
    files = {asset.name: asset.source for asset in catalogue.assets(scene)}
    _store(_mark_path(workspace, scene), {name: files.get(name) for name in names})
    finish_removal(workspace, catalogue, scene)


def finish_removal(workspace: Workspace, catalogue: Catalogue, scene: str) -> list[str]:
    """Completes a removal and returns the names of its assets, none without one. The caller holds the scene's lock. Raises StoreError."""
    mark = _mark_path(workspace, scene)
    try:
        leaving: dict[str, str | None] | list[str] = json.loads(mark.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return []
    # Earlier versions listed the names alone.
    files = leaving if isinstance(leaving, dict) else dict.fromkeys(leaving)
    known = {name: path for name, path in files.items() if path is not None}
    _store(_removed_path(workspace, scene), _read_removed(workspace, scene) | known)
    names = sorted(files)
    for name in names:
        with suppress(NotFound):
            catalogue.remove_asset(scene, name)
        remove_folder(workspace.asset_folder(scene, name))
        remove_checkpoints(workspace.asset_folder(scene, name))
    with Registry(workspace.registry_path(scene)) as registry:
        registry.remove_assets(names)
    mark.unlink()
    return names


def removed_files(workspace: Workspace, scene: str) -> dict[str, Path]:
    """Returns the files of removed assets by name; an asset of that name may be there again."""
    return {name: Path(path) for name, path in _read_removed(workspace, scene).items()}


def is_removing(workspace: Workspace, scene: str) -> bool:
    """Whether a removal has begun and not finished."""
    return _mark_path(workspace, scene).exists()


def remove_folder(folder: Path) -> None:
    """Removes a folder with all files, if it exists. Raises StoreError."""
    try:
        shutil.rmtree(folder)
    except FileNotFoundError:
        if folder.exists():  # a file in it went away meanwhile
            remove_folder(folder)
    except OSError as error:
        raise StoreError(f"{folder}: cannot remove the folder: {error}; fix the cause and re-run the command") from error


def _read_removed(workspace: Workspace, scene: str) -> dict[str, str]:
    try:
        found: dict[str, str] = json.loads(_removed_path(workspace, scene).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    return found


def _store(path: Path, files: Mapping[str, str | None]) -> None:
    """Writes a file of names durably, as a whole or not at all."""
    draft = path.with_name(f"{path.name}.new")
    with draft.open("w", encoding="utf-8") as file:
        json.dump(files, file, sort_keys=True)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


def _removed_path(workspace: Workspace, scene: str) -> Path:
    return workspace.scene_folder(scene) / _REMOVED


def _mark_path(workspace: Workspace, scene: str) -> Path:
    return workspace.scene_folder(scene) / "assets" / _MARK
