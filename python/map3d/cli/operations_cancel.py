"""map3d operations cancel."""

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json


@click.command("cancel")
@click.argument("id")
@json_option
@workspace_option
def command(workspace: Workspace, id: str, as_json: bool) -> None:
    """Cancel a waiting or running operation. A running one stops within seconds and can be retried."""
    catalogue = workspace.open_catalogue()
    try:
        operation = catalogue.cancel_operation(id)
    finally:
        catalogue.close()
    if as_json:
        print_json(operation)
    else:
        click.echo(f"operation {id}: {'cancelling' if operation.cancelling else operation.state}")
