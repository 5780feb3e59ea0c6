"""`map3d remove-scene`: removes a scene with its files, and its renderings if the user wants that."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from map3d.catalogue import Catalogue, Workspace
from map3d.catalogue.scene_lock import scene_lock
from map3d.errors import BadRequest, NotFound
from map3d.ingest.asset_removal import remove_folder
from map3d.ingest.unfinished_imports import running_imports
from map3d.lifecycle.removal_checks import folder_bytes, objects_bytes
from map3d.lifecycle.removal_mark import read_mark, removal_mark
from map3d.lifecycle.remove_rendering import RenderingRemoval, find_rendering, is_rendering_removed, remove_rendering
from map3d.renderings.view_store import remove_views
from map3d.scenes.shared_scene import files_url, remove_shared

_RENDERINGS: Final = "renderings"
_SHARED: Final = "files"


@dataclass(frozen=True)
class SceneRemoval:
    """`files`: number of assets; `bytes`: of the scene, without its renderings; `shared`: URL of the files that other nodes fetch, or None."""

    name: str
    files: int
    bytes: int
    renderings: tuple[RenderingRemoval, ...]
    shared: str | None = None

    @property
    def total_bytes(self) -> int:
        return self.bytes + sum(rendering.bytes for rendering in self.renderings)


def find_scene(workspace: Workspace, catalogue: Catalogue, name: str, *, with_renderings: bool) -> SceneRemoval:
    """Returns what there is to remove, the remains of a removal that was killed included.

    Raises NotFound; BadRequest for a scene with renderings, unless they go too, and while the scene is being changed or rendered.
    """
    folder = workspace.scene_folder(name)
    mark = read_mark(folder)
    remains = _remaining_renderings(workspace, catalogue, mark or {})
    try:
        files, records, shared = len(catalogue.assets(name)), catalogue.renderings(name), files_url(catalogue.scene(name))
    except NotFound:
        if mark is None:
            raise
        files, records, shared = 0, [], mark.get(_SHARED)
    if records and not with_renderings:
        raise BadRequest(
            f"scene {name}: has renderings ({', '.join(record.name for record in records)}); remove them first with map3d remove-rendering, "
            "or give --with-renderings"
        )
    _check_imports(workspace, name)
    renderings = tuple(find_rendering(workspace, catalogue, rendering) for rendering in [*(record.name for record in records), *remains])
    size = folder_bytes(folder) + (0 if shared is None else objects_bytes(shared))
    return SceneRemoval(name, files, size, renderings, shared)


def remove_scene(workspace: Workspace, catalogue: Catalogue, removal: SceneRemoval) -> None:
    """Removes the renderings, then the record, then the stored views and the files.

    Raises BadRequest while the scene is being changed or rendered; StoreError.
    """
    folder = workspace.scene_folder(removal.name)
    with scene_lock(workspace, removal.name, wait=False):
        _check_imports(workspace, removal.name)
        with removal_mark(folder, {_RENDERINGS: [rendering.name for rendering in removal.renderings], _SHARED: removal.shared}):
            for rendering in removal.renderings:
                remove_rendering(workspace, catalogue, rendering)
            with suppress(NotFound):
                catalogue.remove_scene(removal.name)
            remove_views(workspace, removal.name)
            if removal.shared is not None:
                remove_shared(removal.shared)
            remove_folder(folder)


def finish_scene_removal(workspace: Workspace, catalogue: Catalogue, name: str) -> None:
    """Completes a killed removal of a scene that is no longer in the catalogue, before a scene of the same name is created."""
    if read_mark(workspace.scene_folder(name)) is not None and name not in [scene.name for scene in catalogue.scenes()]:
        remove_scene(workspace, catalogue, find_scene(workspace, catalogue, name, with_renderings=False))


def _remaining_renderings(workspace: Workspace, catalogue: Catalogue, mark: Mapping[str, Any]) -> list[str]:
    """Returns the renderings of a killed removal whose record is gone and whose tiles are not."""
    known = {record.name for record in catalogue.renderings()}
    return [name for name in mark.get(_RENDERINGS, []) if name not in known and is_rendering_removed(workspace, name)]


def _check_imports(workspace: Workspace, name: str) -> None:
    if running := running_imports(workspace.scene_folder(name) / "assets"):
        raise BadRequest(f"scene {name}: {', '.join(running)} is being imported by another process; wait for its end")
