"""map3d publish."""

from pathlib import Path
from typing import Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json, size_text
from map3d.cli.progress import progress_bar, show_stage


@click.command("publish")
@click.argument("rendering")
@click.option("-o", "--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Output folder.")
@click.option("--replace", is_flag=True, help="Replace an earlier published folder.")
@click.option("--allow-incomplete", is_flag=True, help="Publish even if blocks are missing.")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, out: Path, replace: bool, allow_incomplete: bool, as_json: bool) -> None:
    """Publish RENDERING as a folder of static files: tiles, objects, viewer. Copy it to any web server that supports range requests."""
    done = publish_with_progress(workspace, rendering, out, replace=replace, allow_incomplete=allow_incomplete)
    if as_json:
        print_json(done)
    else:
        click.echo(f"published {rendering} to {out}: {plural(done.tiles, 'image')} in {plural(done.archives, 'archive')}, {size_text(done.bytes)}")


def publish_with_progress(workspace: Workspace, rendering: str, out: Path, **how: bool) -> Any:
    """Publishes with a progress bar and returns a `Published`."""
    from map3d.publish import publish

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with progress_bar(*columns) as bar:
        task = bar.add_task("publishing", total=None)

        def progress(stage: str, done: int, total: int) -> bool:
            show_stage(bar, task, f"publishing: {stage}", done, total)
            return True

        return publish(workspace, rendering, out, progress=progress, **how)
