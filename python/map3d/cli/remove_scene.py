"""map3d remove-scene."""

import click

from map3d.catalogue import Workspace
from map3d.cli.confirmation import confirm, yes_option
from map3d.cli.folders_that_stay import print_folders_that_stay, published_names
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import names_text, plural, print_json, size_text


@click.command("remove-scene")
@click.argument("scene")
@click.option("--with-renderings", is_flag=True, help="Remove its renderings too.")
@yes_option
@json_option
@workspace_option
def command(workspace: Workspace, scene: str, with_renderings: bool, yes: bool, as_json: bool) -> None:
    """Remove SCENE with everything imported into it. The source files and published folders stay;
    those in the workspace are listed.

    If the removal is interrupted, run the command again to complete it.
    """
    from map3d.jobs.dead_workers import expire_dead_workers
    from map3d.publish.published_folders import folders_of
    from map3d.renderings.remove_scene import find_scene, remove_scene

    catalogue = workspace.open_catalogue()
    try:
        for record in catalogue.renderings(scene):
            expire_dead_workers(catalogue, record.name)
        found = find_scene(workspace, catalogue, scene, with_renderings=with_renderings)
        names = [rendering.name for rendering in found.renderings]
        renderings = f" and the {'rendering' if len(names) == 1 else 'renderings'} {names_text(names)}" if names else ""
        confirm(f"this removes the scene {scene} with {plural(found.files, 'file')}{renderings}, {size_text(found.total_bytes)}", yes=yes)
        remove_scene(workspace, catalogue, found)
    finally:
        catalogue.close()
    folders = folders_of(workspace, names)
    if as_json:
        print_json({"scene": scene, "renderings": names, "bytes": found.total_bytes, "published": published_names(folders)})
    else:
        click.echo(f"removed scene {scene}{renderings}; {size_text(found.total_bytes)} freed")
        print_folders_that_stay(workspace, folders)
