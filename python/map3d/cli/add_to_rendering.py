"""map3d add-views and add-layers."""

import click

from map3d.catalogue import Workspace
from map3d.cli.layer_options import layer_options
from map3d.cli.options import View, json_option, workspace_option
from map3d.cli.output import plural, print_json
from map3d.renderings.layers import LayerRequest
from map3d.types import ViewAngles


@click.command("add-views")
@click.argument("rendering")
@click.option("--view", "views", type=View(), multiple=True, required=True, help="Look-at angle and pitch in degrees, e.g. 45-22.5; repeatable.")
@json_option
@workspace_option
def add_views(workspace: Workspace, rendering: str, views: tuple[ViewAngles, ...], as_json: bool) -> None:
    """Add views to RENDERING. Existing views do not change. Run map3d render afterwards."""
    from map3d.renderings.create import add_views

    with workspace.open_catalogue() as catalogue:
        record = add_views(catalogue, rendering, views)
    if as_json:
        print_json(record)
        return
    click.echo(f"rendering {rendering}: {plural(len(record.frames), 'view')}; next: map3d render {rendering}")


@click.command("add-layers")
@click.argument("rendering")
@layer_options(required=True)
@json_option
@workspace_option
def add_layers(workspace: Workspace, rendering: str, layers: LayerRequest, as_json: bool) -> None:
    """Add layers to all views of RENDERING. Existing layers do not change. Run map3d render afterwards."""
    from map3d.renderings.create import add_layers

    with workspace.open_catalogue() as catalogue:
        record = add_layers(catalogue, rendering, layers)
    if as_json:
        print_json(record)
        return
    click.echo(f"rendering {rendering}: {plural(len(record.layers), 'layer')}; next: map3d render {rendering}")
