"""map3d publish."""

from typing import Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from map3d.catalogue import Workspace
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json, print_table, size_text
from map3d.cli.progress import progress_bar, show_stage
from map3d.requests import Publish


@click.command("publish")
@click.argument("rendering")
@request_options(Publish, out={"required": True})
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, request: Publish, as_json: bool) -> None:
    """Publish RENDERING as static files: tiles, objects, viewer.

    FOLDER can be copied to any web server that supports range requests. URL is a place in an object store; credentials come from the environment
    (AWS_*, GOOGLE_*, AZURE_*)."""
    names = ("replace", "allow_incomplete", "url", "gis", "max_file_bytes", "dry_run")
    done = publish_with_progress(workspace, rendering, request.out, **{name: getattr(request, name) for name in names})
    if as_json:
        print_json(done)
        return
    rows = [(row.part, row.view or "", row.layer or "", row.files, size_text(row.bytes)) for row in done.sizes]
    print_table(("part", "view", "layer", "files", "size"), [*rows, ("total", "", "", done.files, size_text(done.bytes))])
    verb, written, removed = ("would publish", "to write", "to remove") if request.dry_run else ("published", "written", "removed")
    about = "about " if request.dry_run and done.written else ""
    click.echo(
        f"{verb} {rendering} to {request.out}: {plural(done.tiles, 'image')} in {plural(done.archives, 'archive')}, {size_text(done.bytes)}; "
        f"{written}: {plural(done.written, 'file')}, {about}{size_text(done.written_bytes)}; {removed}: {done.removed:,}"
    )
    if request.gis:
        files = next((row for row in done.sizes if row.part == "gis"), None)
        count, size = (0, 0) if files is None else (files.files, files.bytes)
        click.echo(f"for GIS software: {plural(count, 'file')} in the folder gis, {size_text(size)}")


class Rate(ProgressColumn):
    """Steps per second."""

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:,.0f}/s")


def publish_with_progress(workspace: Workspace, rendering: str, out: Any, **how: Any) -> Any:
    """Publishes with a progress bar and returns a `Published`."""
    from map3d.publish import publish

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), Rate(), TimeRemainingColumn())
    with progress_bar(*columns) as bar:
        task = bar.add_task("publishing", total=None)

        def progress(stage: str, done: int, total: int) -> bool:
            show_stage(bar, task, f"publishing {stage}", done, total or None)
            return True

        return publish(workspace, rendering, out, progress=progress, **how)
