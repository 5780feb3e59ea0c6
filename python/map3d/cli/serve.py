"""map3d serve."""

import click

from map3d.catalogue import Workspace
from map3d.cli.options import workspace_option


@click.command("serve")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen at; 0.0.0.0 for all.")
@click.option("--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="0 takes a free one.")
@click.option("--processes", type=click.IntRange(1, 64), default=1, show_default=True, help="How many processes answer.")
@workspace_option
def command(workspace: Workspace, host: str, port: int, processes: int) -> None:
    """Serve the tiles and a map of every rendering until Ctrl-C."""
    from map3d.web.server import serve

    workspace.open_catalogue().close()
    serve(workspace.root, host, port, workers=processes, on_ready=lambda address: click.echo(f"serving at {address}"))
