"""map3d publish."""

from pathlib import Path

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json


@click.command("publish")
@click.argument("rendering")
@click.option(
    "-o", "--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder to write; what is there of it is brought up to date."
)
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, out: Path, as_json: bool) -> None:
    """Write RENDERING as a folder of static files: tiles, objects, viewer. Copy it to any web server."""
    from map3d.publish import publish

    publish(workspace, rendering, out)
    if as_json:
        print_json({"rendering": rendering, "folder": str(out)})
    else:
        click.echo(f"{rendering} is in {out}; put the folder on any web server, or look at it with: python -m http.server -d {out}")
