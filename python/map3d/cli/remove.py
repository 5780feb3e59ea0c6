"""map3d remove-files, remove-rendering and remove-scene."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from map3d.catalogue import Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.confirmation import confirm, yes_option
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import names_text, plural, print_json, size_text
from map3d.cores import usable_cores
from map3d.requests import RemoveFiles, RemoveScene

if TYPE_CHECKING:
    from map3d.publish.published_folders import PublishedFolder


@click.command("remove-files")
@click.argument("scene")
@request_options(RemoveFiles, names={"nargs": -1, "required": True, "metavar": "NAME…", "type": str})
@yes_option
@json_option
@workspace_option
def remove_files(workspace: Workspace, scene: str, request: RemoveFiles, yes: bool, as_json: bool) -> None:
    """Remove imported files from SCENE, by the names that map3d show scene SCENE lists or by file name. The source files stay.

    The scene is built again, so that the space of its meshes and textures is freed; the next map3d render removes the objects from the tiles. The ids
    of other objects stay; an object of a removed file that returns gets its id back. If the removal is interrupted, run the command again.
    """
    from map3d.jobs.dead_workers import expire_dead_workers
    from map3d.lifecycle.removal_checks import folder_bytes
    from map3d.lifecycle.remove_files import find_files, is_built, remove_files

    with workspace.open_catalogue() as catalogue:
        for record in catalogue.renderings(scene):
            expire_dead_workers(catalogue, record.name)
        before = folder_bytes(workspace.scene_folder(scene))
        found = find_files(workspace, catalogue, scene, request.names)
        if found.names:
            files = f"{plural(len(found.names), 'file')} ({names_text(found.names)})"
            confirm(f"this removes {files} from the scene {scene}, {size_text(found.bytes)} and the built files that only they use", yes=yes)
        remove_files(workspace, catalogue, found)
        if is_built(workspace, catalogue, scene):
            build_with_progress(workspace, catalogue, scene, threads=usable_cores())
        freed = max(before - folder_bytes(workspace.scene_folder(scene)), 0)
    removed = sorted({*found.names, *found.finished})
    if as_json:
        print_json({"scene": scene, "removed": removed, "bytes": freed})
        return
    click.echo(f"removed {plural(len(removed), 'file')} from {scene}; {size_text(freed)} freed")
    for rendering in found.renderings:
        click.echo(f"next: map3d render {rendering}")


@click.command("remove-rendering")
@click.argument("rendering")
@yes_option
@json_option
@workspace_option
def remove_rendering(workspace: Workspace, rendering: str, yes: bool, as_json: bool) -> None:
    """Remove RENDERING with its tiles. Its scene and published folders stay; those in the workspace are listed.

    If the removal is interrupted, run the command again to complete it.
    """
    from map3d.jobs.dead_workers import expire_dead_workers
    from map3d.lifecycle.remove_rendering import find_rendering, remove_rendering
    from map3d.publish.published_folders import folders_of

    with workspace.open_catalogue() as catalogue:
        expire_dead_workers(catalogue, rendering)
        found = find_rendering(workspace, catalogue, rendering)
        where = f" at {found.tiles}" if found.tiles else ""
        confirm(f"this removes the rendering {rendering} with its tiles{where}, {size_text(found.bytes)}", yes=yes)
        remove_rendering(workspace, catalogue, found)
    folders = folders_of(workspace, [rendering])
    if as_json:
        print_json({"rendering": rendering, "scene": found.scene, "bytes": found.bytes, "published": _published_names(folders)})
    else:
        click.echo(f"removed rendering {rendering}; {size_text(found.bytes)} freed")
        _print_folders_that_stay(workspace, folders)


@click.command("remove-scene")
@click.argument("scene")
@request_options(RemoveScene)
@yes_option
@json_option
@workspace_option
def remove_scene(workspace: Workspace, scene: str, request: RemoveScene, yes: bool, as_json: bool) -> None:
    """Remove SCENE with everything imported into it. The source files and published folders stay;
    those in the workspace are listed.

    If the removal is interrupted, run the command again to complete it.
    """
    from map3d.jobs.dead_workers import expire_dead_workers
    from map3d.lifecycle.remove_scene import find_scene, remove_scene
    from map3d.publish.published_folders import folders_of

    with workspace.open_catalogue() as catalogue:
        for record in catalogue.renderings(scene):
            expire_dead_workers(catalogue, record.name)
        found = find_scene(workspace, catalogue, scene, with_renderings=request.with_renderings)
        names = [rendering.name for rendering in found.renderings]
        renderings = f" and the {'rendering' if len(names) == 1 else 'renderings'} {names_text(names)}" if names else ""
        confirm(f"this removes the scene {scene} with {plural(found.files, 'file')}{renderings}, {size_text(found.total_bytes)}", yes=yes)
        remove_scene(workspace, catalogue, found)
    folders = folders_of(workspace, names)
    if as_json:
        print_json({"scene": scene, "renderings": names, "bytes": found.total_bytes, "published": _published_names(folders)})
    else:
        click.echo(f"removed scene {scene}{renderings}; {size_text(found.total_bytes)} freed")
        _print_folders_that_stay(workspace, folders)


def _print_folders_that_stay(workspace: Workspace, folders: Sequence["PublishedFolder"]) -> None:
    """Names the folders of the workspace that still hold what was removed."""
    for folder in folders:
        place = workspace.root / "published" / folder.name
        click.echo(f"published files of {folder.rendering} stay in {place}, {size_text(folder.bytes)}; delete the folder to take the map off the web")


def _published_names(folders: Sequence["PublishedFolder"]) -> list[str]:
    return [folder.name for folder in folders]
