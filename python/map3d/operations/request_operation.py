"""Asks for operations: the one way in for the web interface, the REST API and programs."""

from collections.abc import Mapping, Sequence
from typing import Any

from map3d.catalogue import Catalogue, OperationRecord, Workspace
from map3d.errors import BadRequest, NotFound
from map3d.operations.arguments import check_arguments
from map3d.operations.uploaded_files import check_host_path, find_upload
from map3d.publish.folder_target import check_folder
from map3d.publish.published_folders import FOLDER, find_published, folders_of, published_path
from map3d.publish.target import MapIdentity
from map3d.quantities import names_text


def request_operation(
    workspace: Workspace, catalogue: Catalogue, kind: str, target: str, arguments: Mapping[str, Any], asked_by: str
) -> OperationRecord:
    """Stores an operation for the next operation worker, after checking everything that can be checked now.

    Raises NotFound for an unknown target, upload, path or asset; BadRequest for wrong arguments, incomplete uploads and paths outside the allowed
    folders; AlreadyExists for a published folder that holds another map.
    """
    check_arguments(kind, target, arguments)
    if kind == "import":
        _check_files(workspace, arguments, asked_by)
    if kind == "remove":
        _check_removal(workspace, catalogue, target, arguments)
    if kind == "publish":
        _check_publication(workspace, catalogue, target, arguments)
    return catalogue.create_operation(kind, target, arguments, asked_by)


def _check_files(workspace: Workspace, arguments: Mapping[str, Any], user: str) -> None:
    for id in arguments.get("files", ()):
        find_upload(workspace, id, user)
    for path in arguments.get("paths", ()):
        check_host_path(path)


def _check_publication(workspace: Workspace, catalogue: Catalogue, target: str, arguments: Mapping[str, Any]) -> None:
    """Raises AlreadyExists for a folder that holds another map, unless it is to be replaced."""
    folder, record = str(arguments.get("folder", target)), catalogue.rendering(target)
    own = MapIdentity(record.name, catalogue.scene(record.scene).origin)
    check_folder(published_path(workspace, folder), own, bool(arguments.get("replace")), f"folder {folder}", "the option replace")


def _check_removal(workspace: Workspace, catalogue: Catalogue, target: str, arguments: Mapping[str, Any]) -> None:
    if arguments["what"] == "files":
        known = {asset.name for asset in catalogue.assets(target)}
        if unknown := sorted(set(arguments["names"]) - known):
            raise NotFound(f"scene {target}: no asset {', '.join(unknown[:20])}")
    if arguments["what"] == "published":
        find_published(workspace, catalogue.rendering(target).name, arguments["folder"])
    renderings = [record.name for record in catalogue.renderings(target)] if arguments["what"] == "scene" else []
    if renderings and not arguments.get("with_renderings"):
        raise BadRequest(f"scene {target}: has renderings ({', '.join(renderings)}); remove them first, or set with_renderings")
    if arguments["what"] == "rendering":
        renderings = [target]
    _check_folders(workspace, f"{arguments['what']} {target}", renderings, arguments.get("folders"))


def _check_folders(workspace: Workspace, what: str, renderings: Sequence[str], folders: Sequence[str] | None) -> None:
    """Raises BadRequest if there are published folders and the caller has not chosen among them, NotFound for any other folder."""
    known = [folder.name for folder in folders_of(workspace, renderings)]
    if known and folders is None:
        raise BadRequest(
            f"{what}: is published in {names_text([f'{FOLDER}/{name}' for name in known])}; "
            "list in folders those to remove with it, or give an empty list to keep them"
        )
    if unknown := sorted(set(folders or ()) - set(known)):
        raise NotFound(f"{what}: no published folder {names_text(unknown)}")
