"""map3d retry."""

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json


@click.command("retry")
@click.argument("rendering")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, as_json: bool) -> None:
    """Allow three more attempts for the quarantined blocks of RENDERING, and open its cancelled blocks again."""
    catalogue = workspace.open_catalogue()
    try:
        count = catalogue.retry(rendering)
    finally:
        catalogue.close()
    if as_json:
        print_json({"retried": count})
    else:
        click.echo(f"reopened {plural(count, 'block')}" + (f"; next: map3d render {rendering}" if count else ""))
