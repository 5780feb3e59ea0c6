"""map3d estimate."""

from dataclasses import asdict

import click

from map3d.catalogue import Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json, size_text, time_text
from map3d.requests import Estimate


@click.command("estimate")
@click.argument("rendering")
@request_options(Estimate)
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, request: Estimate, as_json: bool) -> None:
    """Estimate the tiles, bytes and minutes of RENDERING before it is rendered.

    Missing and changed blocks count as still to render. Builds the scene first if its files have changed.
    """
    from map3d.renderings.cost_estimate import estimate

    workers, memory = request.processes, request.max_memory_bytes
    with workspace.open_catalogue() as catalogue:
        built = build_with_progress(workspace, catalogue, catalogue.rendering(rendering).scene, threads=workers, max_memory_bytes=memory)
        found = estimate(workspace, catalogue, rendering, workers)
    if as_json:
        print_json({**asdict(found), "build": built})
        return
    tiles = f"{plural(found.base_tiles, 'base tile')}, {plural(found.tiles, 'tile')} on all levels"
    click.echo(f"{rendering}: about {tiles}, {plural(found.images, 'image')}, {size_text(found.bytes)}")
    workers_text = plural(found.workers, "worker")
    click.echo(f"still to render: {plural(found.open_tiles, 'base tile')}, about {time_text(found.seconds)} with {workers_text}")
    click.echo(f"estimated from {found.how}")
