"""map3d jobs cancel."""

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json


@click.command("cancel")
@click.argument("rendering")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, as_json: bool) -> None:
    """Cancel the open blocks of RENDERING, also those that workers render now.

    Rendered tiles stay. map3d render RENDERING and map3d jobs retry RENDERING open the cancelled blocks again.
    """
    catalogue = workspace.open_catalogue()
    try:
        count = catalogue.cancel(rendering)
    finally:
        catalogue.close()
    if as_json:
        print_json({"cancelled": count})
    else:
        click.echo(f"cancelled {plural(count, 'block')}" + (f"; to resume: map3d render {rendering}" if count else ""))
