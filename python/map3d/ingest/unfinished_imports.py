"""Imports that were killed: their drafts are removed, and an import that had begun to change the scene is completed or undone.

The last step of an import changes the registry, the asset's folder and the catalogue one after another. While it lasts, a file `.NAME.importing`
states the source. Whatever folder is in place when the process dies, the registry and the catalogue are brought in line with it.
"""

import json
import os
import shutil
from pathlib import Path
from typing import Any, Final

from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.ingest.asset import asset_digest, new_objects, read_objects, world_boxes
from map3d.ingest.asset_removal import finish_removal
from map3d.process_identity import ProcessIdentity
from map3d.registry import Registry

_DRAFT: Final = ".new"
_MARK: Final = ".importing"


def draft_path(folder: Path) -> Path:
    """Returns the path at which this process prepares the asset folder."""
    return folder.with_name(f".{folder.name}.{ProcessIdentity.current()}{_DRAFT}")


def remove_dead_drafts(assets: Path) -> None:
    """Removes the drafts of processes that have ended."""
    for path in assets.glob(f".*{_DRAFT}"):
        if _has_ended(path.name.removesuffix(_DRAFT).lstrip(".").partition(".")[2]):
            shutil.rmtree(path, ignore_errors=True)


def running_imports(assets: Path) -> list[str]:
    """Returns the names of the assets that a process is importing now."""
    owners = {path.name.removesuffix(_DRAFT).lstrip(".") for path in assets.glob(f".*{_DRAFT}")}
    return sorted({owner.partition(".")[0] for owner in owners if not _has_ended(owner.partition(".")[2])})


def mark_import(folder: Path, source: str, format: str, source_digest: str) -> None:
    """States, durably, that the asset is about to change."""
    path = _mark_path(folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8") as file:
        json.dump({"source": source, "format": format, "source_digest": source_digest}, file)
        file.flush()
        os.fsync(file.fileno())


def unmark_import(folder: Path) -> None:
    """States that the asset's folder, registry and catalogue agree."""
    _mark_path(folder).unlink(missing_ok=True)


def unfinished_imports(assets: Path) -> list[str]:
    """Returns the names of assets whose import has begun to change the scene and has not finished."""
    return sorted(path.name.removesuffix(_MARK).lstrip(".") for path in assets.glob(f".*{_MARK}"))


def finish_imports(workspace: Workspace, catalogue: Catalogue, scene: str) -> None:
    """Completes or undoes killed imports, completes a killed removal, and removes drafts of dead processes. The caller holds the scene's lock."""
    assets = workspace.scene_folder(scene) / "assets"
    remove_dead_drafts(assets)
    finish_removal(workspace, catalogue, scene)
    for name in unfinished_imports(assets):
        folder = workspace.asset_folder(scene, name)
        mark = _read_mark(folder)
        if mark is not None:
            if folder.is_dir():
                _record_asset(catalogue, scene, folder, mark)
            _register_objects(workspace, catalogue, scene, folder)
        unmark_import(folder)


def _record_asset(catalogue: Catalogue, scene: str, folder: Path, mark: dict[str, str]) -> None:
    """Records the folder, unless it is the one that the catalogue knows."""
    digest = asset_digest(folder)
    if digest not in [asset.digest for asset in catalogue.assets(scene) if asset.name == folder.name]:
        report: dict[str, Any] = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        catalogue.put_asset(AssetRecord(scene, folder.name, mark["source"], mark["format"], digest, mark["source_digest"], report))


def _register_objects(workspace: Workspace, catalogue: Catalogue, scene: str, folder: Path) -> None:
    """Registers the objects of the folder; ids stay, since objects are identified by name."""
    origin = catalogue.scene(scene).origin
    lines = read_objects(folder) if folder.is_dir() and origin is not None else []
    objects = new_objects(lines, world_boxes(folder, len(lines)), origin) if lines and origin is not None else []
    with Registry(workspace.registry_path(scene)) as registry:
        registry.put_asset(folder.name, objects)


def _read_mark(folder: Path) -> dict[str, str] | None:
    """Returns None for a mark whose writing was interrupted: then nothing has changed."""
    try:
        mark: dict[str, str] = json.loads(_mark_path(folder).read_text(encoding="utf-8"))
    except ValueError:
        return None
    return mark


def _mark_path(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}{_MARK}")


def _has_ended(owner: str) -> bool:
    """`owner`: an identity; a mere process id in drafts of earlier versions of map3d."""
    identity = ProcessIdentity.parse(owner)
    if identity is None and owner.isdecimal():
        return not Path(f"/proc/{owner}").exists() and Path("/proc/self").exists()
    return identity is not None and identity.has_ended()
