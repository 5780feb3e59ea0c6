"""map3d create-scene."""

import click

from map3d.catalogue import Workspace
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json
from map3d.requests import CreateScene


@click.command("create-scene")
@request_options(CreateScene)
@json_option
@workspace_option
def command(workspace: Workspace, request: CreateScene, as_json: bool) -> None:
    """Create an empty scene NAME, and the workspace if it does not exist."""
    from map3d.lifecycle.create_scene import check_scene, create_scene

    check_scene(request)
    with workspace.create().open_catalogue() as catalogue:
        scene = create_scene(workspace, catalogue, request)
    if as_json:
        print_json(scene)
    else:
        system = "that of the first file" if scene.crs is None else scene.crs.name
        click.echo(f"created scene {request.name} in {workspace.root} (coordinate system: {system}); next: map3d add-files {request.name} FILE…")
