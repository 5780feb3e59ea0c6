"""map3d serve."""

import click

from map3d.catalogue import Workspace
from map3d.cli.options import workspace_option


@click.command("serve")
@click.argument("rendering", required=False)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on; 0.0.0.0 for all interfaces.")
@click.option("--port", type=click.IntRange(0, 65535), default=8080, show_default=True, help="Port to listen on; 0 selects a free one.")
@click.option("--processes", type=click.IntRange(1, 64), default=1, show_default=True, help="Number of server processes.")
@workspace_option
def command(workspace: Workspace, rendering: str | None, host: str, port: int, processes: int) -> None:
    """Serve the maps of all renderings until Ctrl-C.

    Prints the address of the map of RENDERING, or of the only rendering; with several renderings, the address of their list.
    """
    from map3d.web.server import serve

    page = page_path(workspace, rendering)
    serve(workspace.root, host, port, workers=processes, on_ready=lambda address: click.echo(f"serving at {address}{page}"))


def page_path(workspace: Workspace, rendering: str | None) -> str:
    """Returns the path of the rendering's map relative to the server's address; empty for the list of renderings. Raises NotFound."""
    catalogue = workspace.open_catalogue()
    try:
        names = [catalogue.rendering(rendering).name] if rendering is not None else [record.name for record in catalogue.renderings()]
    finally:
        catalogue.close()
    return f"view/{names[0]}/" if len(names) == 1 else ""
