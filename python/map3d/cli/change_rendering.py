"""map3d change-rendering."""

import click

from map3d.catalogue import Workspace
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json
from map3d.errors import BadRequest
from map3d.requests import ChangeRendering


@click.command("change-rendering")
@click.argument("rendering")
@request_options(ChangeRendering)
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, request: ChangeRendering, as_json: bool) -> None:
    """Change title, attribution, description or start view of RENDERING. Nothing is rendered.

    map3d serve shows the change at once, publications when they are published again.
    """
    from map3d.lifecycle.change_rendering import change_rendering

    if request == ChangeRendering():
        raise BadRequest(f"rendering {rendering}: nothing to change; give --title, --attribution, --description or --start-view")
    with workspace.open_catalogue() as catalogue:
        record = change_rendering(workspace, catalogue, rendering, request)
    if as_json:
        print_json(record)
        return
    click.echo(f"changed {rendering}; next: map3d publish {rendering} -o FOLDER updates a publication")
