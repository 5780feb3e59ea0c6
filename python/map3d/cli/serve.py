"""map3d serve."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path

import click

from map3d.catalogue import Workspace
from map3d.cli.option_types import Bytes
from map3d.cli.options import workspace_option


@click.command("serve")
@click.argument("rendering", required=False)
@click.option("--host", help="Address to listen on; 0.0.0.0 for all interfaces.  [default: 127.0.0.1]")
@click.option("--port", type=click.IntRange(0, 65535), help="Port to listen on; 0 selects a free one.  [default: 8080]")
@click.option("--processes", type=click.IntRange(1, 64), help="Number of server processes.  [default: 1]")
@click.option("--public-url", metavar="URL", help="Address of the server as browsers see it, behind a proxy.")
@click.option("--on-demand", is_flag=True, default=None, help="Render missing and changed tiles when they are asked for.")
@click.option("--on-demand-quota", type=Bytes(), metavar="SIZE", help="Disk space for blocks rendered on demand, e.g. 20G.  [default: 5 GB]")
@click.option("--metrics", metavar="HOST:PORT", help="Serve Prometheus metrics there, e.g. 127.0.0.1:9464.")
@click.option("--log-format", type=click.Choice(["text", "json"]), help="Format of the log on standard error.  [default: text]")
@click.option("--access-log", is_flag=True, default=None, help="Log every request.")
@click.option("--config", type=click.Path(path_type=Path), envvar="MAP3D_CONFIG", show_envvar=True, help="Configuration file (TOML).")
@click.option("--no-worker", is_flag=True, help="Start no operation worker; map3d work --operations is one by itself.")
@workspace_option
def command(
    workspace: Workspace, rendering: str | None, on_demand_quota: int | None, config: Path | None, no_worker: bool, **options: str | int | bool | None
) -> None:
    """Serve the maps of all renderings until Ctrl-C, and do the operations that are asked for meanwhile.

    Prints the address of the map of RENDERING, or of the only rendering; with several renderings, the address of their list.

    With --on-demand, every server process renders planned blocks with one subprocess when their tiles are asked for. Plan them with map3d render
    --plan-only. Blocks that were used least recently are removed when the quota is reached.

    All settings can also be in the configuration file and the environment; docs/server.md has the table. SIGHUP reads them again without a failed
    request.
    """
    from map3d.operations.worker_process import WorkerProcess, is_worker_alive
    from map3d.web.http.settings import load_settings
    from map3d.web.server.serve import serve

    page = page_path(workspace, rendering)
    if on_demand_quota is not None:
        options |= {"on_demand": True, "on_demand_quota_gb": str(on_demand_quota / 1e9)}
    load = partial(load_settings, config, options)
    settings = load()
    with nullcontext() if no_worker else WorkerProcess(workspace.root) as worker:
        serve(
            workspace.root,
            settings.host,
            settings.port,
            workers=settings.processes,
            settings=settings,
            reload_settings=load,
            parts=None if worker is None else {"operations": partial(is_worker_alive, worker.identity_path)},
            on_ready=lambda address: click.echo(f"serving at {address}{page}"),
        )


def page_path(workspace: Workspace, rendering: str | None) -> str:
    """Returns the path of the rendering's map relative to the server's address; empty for the list of renderings. Raises NotFound."""
    with workspace.open_catalogue() as catalogue:
        names = [catalogue.rendering(rendering).name] if rendering is not None else [record.name for record in catalogue.renderings()]
    return f"view/{names[0]}/" if len(names) == 1 else ""
