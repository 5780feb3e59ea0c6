"""map3d operations show."""

import click

from map3d.catalogue import Workspace
from map3d.cli.operations import progress_text, state_text
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json


@click.command("show")
@click.argument("id")
@json_option
@workspace_option
def command(workspace: Workspace, id: str, as_json: bool) -> None:
    """Show an operation and its log."""
    catalogue = workspace.open_catalogue()
    try:
        operation = catalogue.operation(id)
        lines, after = [], 0
        while page := catalogue.operation_log(id, after):
            lines += page
            after = page[-1].number
    finally:
        catalogue.close()
    if as_json:
        print_json({"operation": operation, "log": lines})
        return
    click.echo(
        f"operation {operation.id}: {operation.kind} {operation.target}, asked for by {operation.asked_by} at {operation.created:%Y-%m-%d %H:%M} UTC"
    )
    click.echo(f"{state_text(operation)}: {progress_text(operation)}")
    for line in lines:
        click.echo(f"{line.time:%H:%M:%S}  {line.text}")
