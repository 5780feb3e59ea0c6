"""Does the operation remove. A removal that was killed is completed by its repetition; what is gone already counts as removed."""

from typing import Final

from map3d.catalogue import Catalogue, OperationRecord, Workspace
from map3d.errors import NotFound
from map3d.jobs.dead_workers import expire_dead_workers
from map3d.lifecycle.remove_files import find_files, is_built, remove_files
from map3d.lifecycle.remove_rendering import find_rendering, remove_rendering
from map3d.lifecycle.remove_scene import find_scene, remove_scene
from map3d.messages import Message, message
from map3d.operations.do_import import build_if_stale
from map3d.operations.operation_report import OperationReport
from map3d.publish.published_folders import FOLDER, remove_published, remove_with_renderings
from map3d.requests.scenes import WorkLimits


def do_removal(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> Message:
    what = operation.arguments["what"]
    report.progress(message("removing"))
    try:
        return _REMOVE[what](workspace, catalogue, operation, report)
    except NotFound:
        if what == "published":
            return message("published-removed-already", name=operation.arguments["folder"])
        if operation.target in [*(scene.name for scene in catalogue.scenes()), *(record.name for record in catalogue.renderings())]:
            raise
        return message(f"{what}-removed-already", name=operation.target)


def _remove_scene(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, _: OperationReport) -> Message:
    for record in _renderings(catalogue, operation.target):
        expire_dead_workers(catalogue, record)
    found = find_scene(workspace, catalogue, operation.target, with_renderings=bool(operation.arguments.get("with_renderings")))
    folders = operation.arguments.get("folders", ())
    published = remove_with_renderings(workspace, [rendering.name for rendering in found.renderings], folders)
    remove_scene(workspace, catalogue, found)
    counts = {"file": found.files, "rendering": len(found.renderings), **({"published-folder": len(folders)} if folders else {})}
    parts = [message(noun, count=count) for noun, count in counts.items()]
    return message("scene-removed", scene=found.name, parts=parts, bytes=found.total_bytes + published)


def _renderings(catalogue: Catalogue, scene: str) -> list[str]:
    return [record.name for record in catalogue.renderings(scene)]


def _remove_rendering(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, _: OperationReport) -> Message:
    expire_dead_workers(catalogue, operation.target)
    found = find_rendering(workspace, catalogue, operation.target)
    folders = operation.arguments.get("folders", ())
    published = remove_with_renderings(workspace, [found.name], folders)
    remove_rendering(workspace, catalogue, found)
    removed = {"rendering": found.name, "bytes": found.bytes + published}
    if folders:
        return message("rendering-removed-with-folders", **removed, folders=[f"{FOLDER}/{name}" for name in folders])
    return message("rendering-removed", **removed)


def _remove_files(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> Message:
    """Names that are gone already are those that this operation removed before a kill: they were checked when it was asked for."""
    scene = operation.target
    for record in _renderings(catalogue, scene):
        expire_dead_workers(catalogue, record)
    present = {asset.name for asset in catalogue.assets(scene)}
    found = find_files(workspace, catalogue, scene, [name for name in operation.arguments["names"] if name in present])
    remove_files(workspace, catalogue, found)
    if is_built(workspace, catalogue, scene):
        build_if_stale(workspace, catalogue, scene, WorkLimits(), report)
    return message("files-removed", files=len(operation.arguments["names"]), scene=scene)


def _remove_published(workspace: Workspace, _: Catalogue, operation: OperationRecord, __: OperationReport) -> Message:
    name = operation.arguments["folder"]
    return message("folder-removed", bytes=remove_published(workspace, operation.target, name), folder=f"{FOLDER}/{name}")


_REMOVE: Final = {"scene": _remove_scene, "rendering": _remove_rendering, "files": _remove_files, "published": _remove_published}
