"""Build: the assets of a scene become chunks, textures and the scene index (spec/scene.md)."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from map3d import _core
from map3d.catalogue import Catalogue, SceneRecord, Workspace
from map3d.catalogue.records import HEIGHTS_DIFFER
from map3d.catalogue.scene_lock import scene_lock
from map3d.coherence import check
from map3d.coherence.check import check_locked_scene, is_checked
from map3d.cores import usable_cores
from map3d.errors import BadRequest
from map3d.ingest.asset_removal import is_removing
from map3d.ingest.unfinished_imports import finish_imports, unfinished_imports
from map3d.registry import Registry
from map3d.scenes.build_process import BuildProgress, build_in_subprocess
from map3d.scenes.outlier_lines import outlier_lines
from map3d.scenes.outliers import OutlierCheck
from map3d.scenes.scene_cache import has_assets
from map3d.scenes.shared_scene import FILES, share_scene
from map3d.scenes.texture_faults import report_texture_faults

OPTIONS: Final[Mapping[str, Any]] = {
    "merge_vertices": True,
    "merge_faces": True,
    "drop_degenerate": True,
    "merge_materials": True,
    "drop_untextured": False,
    "ground_plane": "auto",
}
_NOT_OF_BUILDS: Final = (FILES, HEIGHTS_DIFFER, *check.OPTIONS)
"""Options of scenes on which a build does not depend, or by way of the check of coherence alone."""
GROUND: Final = "ground"
BUILD_BYTES: Final = 2 << 30
"""Default memory limit of a build."""


def is_stale(workspace: Workspace, catalogue: Catalogue, scene: str) -> bool:
    """Whether the scene index is missing or older than the assets, or an import or a removal was killed while it changed the scene."""
    record = catalogue.scene(scene)
    if unfinished_imports(workspace.scene_folder(scene) / "assets") or is_removing(workspace, scene):
        return True
    if record.built != scene_digest(catalogue, record):
        return True
    folder = workspace.scene_folder(scene)
    if has_assets(folder) and not is_checked(workspace, catalogue, record):
        return True
    return (FILES not in record.options or has_assets(folder)) and not (folder / "scene.json").is_file()


def build(
    workspace: Workspace, catalogue: Catalogue, scene: str, *, threads: int, max_memory_bytes: int, progress: BuildProgress | None = None
) -> dict[str, Any]:
    """Builds what changed, uploads the files of a shared scene, and returns the report: counts of each optimisation. Raises BadRequest for a scene
    without assets, or on a node that only has a copy."""
    with scene_lock(workspace, scene):
        finish_imports(workspace, catalogue, scene)
        record = catalogue.scene(scene)
        assets = catalogue.assets(scene)
        if not assets or record.origin is None:
            raise BadRequest(f"scene {scene} has no files yet; add some with map3d add-files {scene} FILE…")
        digest = scene_digest(catalogue, record)
        folder = workspace.scene_folder(scene)
        if not has_assets(folder):
            raise BadRequest(f"scene {scene}: its files were imported on another host; build it there with map3d render")
        check_locked_scene(workspace, catalogue, scene)
        options = _build_options(record)
        outlier_check = OutlierCheck(workspace, record, assets, options)
        with Registry(workspace.registry_path(scene)) as registry:
            ground = registry.get_or_create_scene_object(GROUND, "terrain")
            request = {
                "assets": [asset.name for asset in assets],
                "origin": record.origin,
                "options": options,
                "ground_id": ground,
                "threads": threads,
            }
            report = build_in_subprocess(scene, folder, request, max_memory_bytes, progress)
            outliers = outlier_check.finish(registry)
            report_texture_faults(workspace, catalogue, scene, report.pop("texture_faults", {}))
            has_ground = report.get("ground_plane_triangles")
            registry.set_scene_object(ground, open_scene(workspace, scene).object_box(ground) if has_ground else None)
        if FILES in record.options:
            share_scene(workspace, record, digest)
        catalogue.set_built(scene, digest)
        lines = outlier_lines(outliers, record.crs)
        return report | ({"outliers": asdict(outliers), "outlier_lines": lines} if lines else {})


def build_if_stale(
    workspace: Workspace,
    catalogue: Catalogue,
    scene: str,
    *,
    threads: int | None = None,
    max_memory_bytes: int | None = None,
    progress: BuildProgress | None = None,
) -> dict[str, Any] | None:
    """Builds the scene if its files have changed, with one thread per core unless given; returns the report, None if the scene is up to date."""
    if not is_stale(workspace, catalogue, scene):
        return None
    memory = max_memory_bytes or BUILD_BYTES
    return build(workspace, catalogue, scene, threads=threads or usable_cores(), max_memory_bytes=memory, progress=progress)


def scene_digest(catalogue: Catalogue, record: SceneRecord) -> str:
    """Returns a digest of everything that a build depends on."""
    assets = [(asset.name, asset.digest) for asset in catalogue.assets(record.name)]
    checked = [check.VERSION, *(record.options.get(name) for name in check.OPTIONS)]
    text = json.dumps([assets, record.origin, _build_options(record), _core.__version__, _core.SCENE_VERSIONS, checked], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _build_options(record: SceneRecord) -> dict[str, Any]:
    """Returns the options of the build itself."""
    return {**OPTIONS, **{name: value for name, value in record.options.items() if name not in _NOT_OF_BUILDS}}


def open_scene(workspace: Workspace, scene: str, cache_bytes: int = 64 << 20) -> _core.Scene:
    """Opens the built scene, for planning and checking."""
    return _core.Scene(str(workspace.scene_folder(scene)), cache_bytes=cache_bytes)
