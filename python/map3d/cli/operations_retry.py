"""map3d operations retry."""

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json


@click.command("retry")
@click.argument("id")
@json_option
@workspace_option
def command(workspace: Workspace, id: str, as_json: bool) -> None:
    """Do a failed or cancelled operation again; it goes on where it ended."""
    catalogue = workspace.open_catalogue()
    try:
        operation = catalogue.retry_operation(id)
    finally:
        catalogue.close()
    if as_json:
        print_json(operation)
    else:
        click.echo(f"operation {id} waits for an operation worker: map3d serve, or map3d work --operations")
