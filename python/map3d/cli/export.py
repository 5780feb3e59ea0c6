"""map3d export."""

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.catalogue import Workspace
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json, size_text
from map3d.cli.progress import progress_bar
from map3d.geometry.views import view_id
from map3d.requests import Export


@click.command("export")
@click.argument("rendering")
@request_options(Export)
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, request: Export, as_json: bool) -> None:
    """Export one view and layer of RENDERING for other software.

    The tiles are in the view's own plane, not on the globe. A stopped export to a folder or a Deep Zoom Image resumes.
    """
    from map3d.publish.exports import export

    view = view_id(request.view)
    with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("exporting tiles", total=None)

        def progress(done: int, total: int) -> bool:
            bar.update(task, completed=done, total=total)
            return True

        done = export(workspace, rendering, request.out, to=request.to, view=view, layer=request.layer, progress=progress)
    if as_json:
        print_json(done)
    else:
        click.echo(f"exported {rendering}, view {view}, layer {request.layer} to {done.path}: {plural(done.tiles, 'tile')}, {size_text(done.bytes)}")
