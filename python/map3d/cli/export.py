"""map3d export."""

from pathlib import Path
from typing import get_args

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.catalogue import Workspace
from map3d.cli.options import View, json_option, workspace_option
from map3d.cli.output import plural, print_json, size_text
from map3d.cli.progress import progress_bar
from map3d.geometry.views import view_id
from map3d.publish.exports import Format
from map3d.types import ViewAngles


@click.command("export")
@click.argument("rendering")
@click.option("--to", "to", type=click.Choice(get_args(Format)), required=True, help="MBTiles, a folder of z/x/y files, or a Deep Zoom Image.")
@click.option("--view", type=View(), required=True, help="Look-at angle and pitch, e.g. 45-22.5.")
@click.option("--layer", default="color", show_default=True, help="Layer to export.")
@click.option("-o", "--out", type=click.Path(path_type=Path), required=True, help="File NAME.mbtiles or NAME.dzi, or folder.")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, to: Format, view: ViewAngles, layer: str, out: Path, as_json: bool) -> None:
    """Export one view and layer of RENDERING for other software.

    The tiles are in the view's own plane, not on the globe. A stopped export to a folder or a Deep Zoom Image resumes.
    """
    from map3d.publish.exports import export

    with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("exporting tiles", total=None)

        def progress(done: int, total: int) -> bool:
            bar.update(task, completed=done, total=total)
            return True

        done = export(workspace, rendering, out, to=to, view=view_id(view), layer=layer, progress=progress)
    if as_json:
        print_json(done)
    else:
        click.echo(f"exported {rendering}, view {view_id(view)}, layer {layer} to {done.path}: {plural(done.tiles, 'tile')}, {size_text(done.bytes)}")
