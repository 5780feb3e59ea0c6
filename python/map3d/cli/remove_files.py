"""map3d remove-files."""

from collections.abc import Sequence

import click

from map3d.catalogue import Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.confirmation import confirm, yes_option
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import names_text, plural, print_json, size_text
from map3d.cores import usable_cores


@click.command("remove-files")
@click.argument("scene")
@click.argument("names", nargs=-1, required=True, metavar="NAME…")
@yes_option
@json_option
@workspace_option
def command(workspace: Workspace, scene: str, names: Sequence[str], yes: bool, as_json: bool) -> None:
    """Remove imported files from SCENE, by the names that map3d show scene SCENE lists or by file name. The source files stay.

    The scene is built again, so that the space of its meshes and textures is freed; the next map3d render removes the objects from the tiles. The ids
    of other objects stay; an object of a removed file that returns gets its id back. If the removal is interrupted, run the command again.
    """
    from map3d.jobs.dead_workers import expire_dead_workers
    from map3d.renderings.removal_checks import folder_bytes
    from map3d.renderings.remove_files import find_files, is_built, remove_files

    catalogue = workspace.open_catalogue()
    try:
        for record in catalogue.renderings(scene):
            expire_dead_workers(catalogue, record.name)
        before = folder_bytes(workspace.scene_folder(scene))
        found = find_files(workspace, catalogue, scene, names)
        if found.names:
            files = f"{plural(len(found.names), 'file')} ({names_text(found.names)})"
            confirm(f"this removes {files} from the scene {scene}, {size_text(found.bytes)} and the built files that only they use", yes=yes)
        remove_files(workspace, catalogue, found)
        if is_built(workspace, catalogue, scene):
            build_with_progress(workspace, catalogue, scene, threads=usable_cores())
        freed = max(before - folder_bytes(workspace.scene_folder(scene)), 0)
    finally:
        catalogue.close()
    removed = sorted({*found.names, *found.finished})
    if as_json:
        print_json({"scene": scene, "removed": removed, "bytes": freed})
        return
    click.echo(f"removed {plural(len(removed), 'file')} from {scene}; {size_text(freed)} freed")
    for rendering in found.renderings:
        click.echo(f"next: map3d render {rendering}")
