"""map3d remove-rendering."""

import click

from map3d.catalogue import Workspace
from map3d.cli.confirmation import confirm, yes_option
from map3d.cli.folders_that_stay import print_folders_that_stay, published_names
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json, size_text


@click.command("remove-rendering")
@click.argument("rendering")
@yes_option
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, yes: bool, as_json: bool) -> None:
    """Remove RENDERING with its tiles. Its scene and published folders stay; those in the workspace are listed.

    If the removal is interrupted, run the command again to complete it.
    """
    from map3d.jobs.dead_workers import expire_dead_workers
    from map3d.publish.published_folders import folders_of
    from map3d.renderings.remove_rendering import find_rendering, remove_rendering

    catalogue = workspace.open_catalogue()
    try:
        expire_dead_workers(catalogue, rendering)
        found = find_rendering(workspace, catalogue, rendering)
        where = f" at {found.tiles}" if found.tiles else ""
        confirm(f"this removes the rendering {rendering} with its tiles{where}, {size_text(found.bytes)}", yes=yes)
        remove_rendering(workspace, catalogue, found)
    finally:
        catalogue.close()
    folders = folders_of(workspace, [rendering])
    if as_json:
        print_json({"rendering": rendering, "scene": found.scene, "bytes": found.bytes, "published": published_names(folders)})
    else:
        click.echo(f"removed rendering {rendering}; {size_text(found.bytes)} freed")
        print_folders_that_stay(workspace, folders)
