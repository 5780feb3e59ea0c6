"""map3d add-layers."""

import click

from map3d.catalogue import Workspace
from map3d.cli.layer_options import layer_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json
from map3d.renderings.layers import LayerRequest


@click.command("add-layers")
@click.argument("rendering")
@layer_options(required=True)
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, layers: LayerRequest, as_json: bool) -> None:
    """Add layers to all views of RENDERING. Existing layers do not change. Run map3d render afterwards."""
    from map3d.renderings.create import add_layers

    catalogue = workspace.open_catalogue()
    try:
        record = add_layers(catalogue, rendering, layers)
    finally:
        catalogue.close()
    if as_json:
        print_json(record)
        return
    click.echo(f"rendering {rendering}: {plural(len(record.layers), 'layer')}; next: map3d render {rendering}")
