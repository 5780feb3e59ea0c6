"""`map3d remove-files`: removes imported files from a scene."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from map3d.catalogue import AssetRecord, Catalogue, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.coherence.check import FILE as CHECK
from map3d.errors import BadRequest, NotFound
from map3d.ingest.asset_removal import finish_removal, remove_assets, remove_folder
from map3d.ingest.unfinished_imports import finish_imports
from map3d.lifecycle.removal_checks import check_idle, folder_bytes
from map3d.scenes.outliers import FILE as OUTLIERS


@dataclass(frozen=True)
class FilesRemoval:
    """`names`: of assets, sorted; `bytes`: of the imported files, without those that a build derives from them; `renderings`: those of the scene.
    `finished`: assets whose removal had been killed and is complete now."""

    scene: str
    names: tuple[str, ...]
    bytes: int
    renderings: tuple[str, ...]
    finished: tuple[str, ...] = ()


def find_files(workspace: Workspace, catalogue: Catalogue, scene: str, given: Sequence[str]) -> FilesRemoval:
    """Returns the assets with these names or file names, and completes a removal that was killed.

    Raises NotFound for an unknown name; BadRequest while the scene is being changed or rendered.
    """
    catalogue.scene(scene)
    renderings = tuple(record.name for record in catalogue.renderings(scene))
    for rendering in renderings:
        check_idle(catalogue, rendering)
    with scene_lock(workspace, scene, wait=False):
        finished = finish_removal(workspace, catalogue, scene)
        finish_imports(workspace, catalogue, scene)
    assets = catalogue.assets(scene)
    names = sorted({_find(scene, assets, name) for name in given if name not in finished})
    size = sum(folder_bytes(workspace.asset_folder(scene, name)) for name in names)
    return FilesRemoval(scene, tuple(names), size, renderings, tuple(finished))


def remove_files(workspace: Workspace, catalogue: Catalogue, removal: FilesRemoval) -> None:
    """Removes the assets; the next build and render follow. Removes the built files too when no asset is left."""
    for rendering in removal.renderings:
        check_idle(catalogue, rendering)
    with scene_lock(workspace, removal.scene, wait=False):
        finish_imports(workspace, catalogue, removal.scene)
        if removal.names:
            remove_assets(workspace, catalogue, removal.scene, removal.names)
        if not catalogue.assets(removal.scene):
            remove_built_files(workspace, removal.scene)


def is_built(workspace: Workspace, catalogue: Catalogue, scene: str) -> bool:
    """Whether the scene has files and was built: after a removal it is built again, so that no file of it is left that nothing uses."""
    return bool(catalogue.assets(scene)) and (workspace.scene_folder(scene) / "scene.json").is_file()


def remove_built_files(workspace: Workspace, scene: str) -> None:
    """Removes everything that a build made, the index first, so that the rest is never taken for a built scene. The caller holds the scene's lock."""
    folder = workspace.scene_folder(scene)
    for name in ("scene.json", "instances.m3i", OUTLIERS, CHECK):
        (folder / name).unlink(missing_ok=True)
    for name in ("chunks", "build", "textures"):
        remove_folder(folder / name)


def _find(scene: str, assets: Sequence[AssetRecord], name: str) -> str:
    if any(asset.name == name for asset in assets):
        return name
    found = [asset.name for asset in assets if Path(asset.source).name == Path(name).name]
    if len(found) > 1:
        raise BadRequest(f"scene {scene}: {name} is the file of several assets: {', '.join(sorted(found))}; give their names")
    if not found:
        names = [asset.name for asset in assets]
        listed = ", ".join(names[:20]) + (", …" if len(names) > 20 else "") if names else "none"
        raise NotFound(f"scene {scene}: no asset and no file {name!r}; its assets: {listed}")
    return found[0]
