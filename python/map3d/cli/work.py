"""map3d work."""

from dataclasses import asdict

import click

from map3d.catalogue import Workspace
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json, size_text
from map3d.errors import FAILED, BadRequest
from map3d.requests.scenes import WorkLimits


@click.command("work")
@click.argument("renderings", nargs=-1)
@request_options(WorkLimits)
@click.option("--operations", is_flag=True, help="Do operations instead: imports, builds, renders … asked for in the web interface or by programs.")
@click.option("--forever", is_flag=True, help="Wait for more work when nothing is left, until stopped.")
@json_option
@workspace_option
def command(workspace: Workspace, renderings: tuple[str, ...], request: WorkLimits, operations: bool, forever: bool, as_json: bool) -> None:
    """Help to render RENDERINGS, or all renderings with open blocks, until nothing is left.

    Joins a map3d render that runs in another process or on another node, and keeps working after that process ends. The last process to finish
    writes the manifest. map3d work itself never plans: start it after map3d render, or with --forever.

    Ctrl-C or SIGTERM finishes the current blocks and exits with status 0; a second one releases them and stops at once.

    With --operations, does the operations that map3d operations lists, one after another; map3d serve starts such a worker itself.
    """
    if operations:
        do_operations(workspace, renderings, forever=forever, as_json=as_json)
        return
    from map3d.cli.run_progress import RunProgress
    from map3d.jobs.run_settings import RunSettings
    from map3d.jobs.work import Work

    with workspace.open_catalogue() as catalogue, RunProgress() as progress:
        result = Work(workspace, catalogue, RunSettings(request.processes, request.max_memory_bytes), renderings, forever=forever).run(progress)
    if as_json:
        print_json(asdict(result))
    else:
        done = result.statistics
        images = f"{plural(done.base_tiles, 'base tile')}, {plural(done.tiles, 'image')}, {size_text(done.bytes)}"
        click.echo(f"rendered {plural(done.done, 'block')} of {plural(len(result.renderings), 'rendering')}: {images}")
        for name in result.incomplete:
            click.echo(f"{name} is incomplete; see map3d jobs {name}", err=True)
    if result.incomplete:
        raise click.exceptions.Exit(FAILED)


def do_operations(workspace: Workspace, renderings: tuple[str, ...], *, forever: bool, as_json: bool) -> None:
    from map3d.operations.operation_worker import OperationWorker

    if renderings:
        raise BadRequest(f"--operations takes no renderings, got {', '.join(renderings)}")
    with workspace.open_catalogue() as catalogue:
        ended = OperationWorker(workspace, catalogue, on_operation=lambda line: click.echo(line, err=True)).run(forever=forever)
    if as_json:
        print_json({"operations": ended})
    else:
        click.echo(f"{plural(ended, 'operation')} ended")
