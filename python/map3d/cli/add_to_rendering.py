"""map3d add-views and add-layers."""

import click

from map3d.catalogue import Workspace
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json
from map3d.requests import AddLayers, AddViews


@click.command("add-views")
@click.argument("rendering")
@request_options(AddViews)
@json_option
@workspace_option
def add_views(workspace: Workspace, rendering: str, request: AddViews, as_json: bool) -> None:
    """Add views to RENDERING. Existing views do not change. Run map3d render afterwards."""
    from map3d.lifecycle.create_rendering import add_views

    with workspace.open_catalogue() as catalogue:
        record = add_views(catalogue, rendering, request.views)
    if as_json:
        print_json(record)
        return
    click.echo(f"rendering {rendering}: {plural(len(record.frames), 'view')}; next: map3d render {rendering}")


@click.command("add-layers")
@click.argument("rendering")
@request_options(AddLayers)
@json_option
@workspace_option
def add_layers(workspace: Workspace, rendering: str, request: AddLayers, as_json: bool) -> None:
    """Add layers to all views of RENDERING. Existing layers do not change. Run map3d render afterwards."""
    from map3d.lifecycle.create_rendering import add_layers

    with workspace.open_catalogue() as catalogue:
        record = add_layers(catalogue, rendering, request)
    if as_json:
        print_json(record)
        return
    click.echo(f"rendering {rendering}: {plural(len(record.layers), 'layer')}; next: map3d render {rendering}")
