"""map3d create-rendering."""

from dataclasses import asdict

import click

from map3d.catalogue import Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json
from map3d.cores import usable_cores
from map3d.requests.renderings import BuildAndCreateRendering


@click.command("create-rendering")
@request_options(BuildAndCreateRendering)
@json_option
@workspace_option
def command(workspace: Workspace, request: BuildAndCreateRendering, as_json: bool) -> None:
    """Create the rendering NAME of SCENE with its views, layers and resolution. Run map3d render afterwards.

    Look-at angle 0 looks north, 45 north-west, 90 west; the pitch is the angle below the horizon. The frame of each view is fixed now, so that
    later additions do not renumber any tile.
    """
    from map3d.lifecycle.create_rendering import check_rendering, create_rendering
    from map3d.scenes.outliers import choose_content
    from map3d.scenes.style import choose_style

    name, scene, memory = request.name, request.scene, request.max_memory_bytes
    with workspace.open_catalogue() as catalogue:
        check_rendering(catalogue, request)
        choose_content(catalogue, scene, request.keep_outliers, request.cluster)
        choose_style(catalogue, scene, request.style)
        built = build_with_progress(workspace, catalogue, scene, threads=usable_cores(), max_memory_bytes=memory)
        record = create_rendering(workspace, catalogue, request)
    if as_json:
        print_json({**asdict(record), "build": built})
        return
    levels, side = record.zmax + 1, record.tile_px << record.zmax
    shape = f"{plural(len(record.frames), 'view')}, {plural(levels, 'level')}"
    click.echo(f"rendering {name}: {shape}, {record.res_m:g} m per pixel, {side:,} px wide at the deepest level")
    click.echo(f"next: map3d estimate {name}, or map3d render {name}")
