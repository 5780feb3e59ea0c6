"""map3d work."""

from dataclasses import asdict

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, max_memory_option, workers_option, workspace_option
from map3d.cli.output import plural, print_json, size_text


@click.command("work")
@click.argument("renderings", nargs=-1)
@workers_option
@max_memory_option
@click.option("--forever", is_flag=True, help="Wait for more work when nothing is left, until stopped.")
@json_option
@workspace_option
def command(workspace: Workspace, renderings: tuple[str, ...], workers: int, max_memory: int | None, forever: bool, as_json: bool) -> None:
    """Help to render RENDERINGS, or all renderings with open blocks, until nothing is left.

    Joins a map3d render that runs in another process or on another node, and also goes on when that one has ended. The last process to finish
    writes the manifest. map3d work itself never plans: start it after map3d render, or with --forever.

    Ctrl-C or SIGTERM finishes the current blocks and exits with status 0; a second one releases them and stops at once.
    """
    from map3d.cli.run_progress import RunProgress
    from map3d.jobs.run_settings import RunSettings
    from map3d.jobs.work import Work

    catalogue = workspace.open_catalogue()
    try:
        with RunProgress() as progress:
            result = Work(workspace, catalogue, RunSettings(workers, max_memory), renderings, forever=forever).run(progress)
    finally:
        catalogue.close()
    if as_json:
        print_json(asdict(result))
    else:
        done = result.statistics
        images = f"{plural(done.base_tiles, 'base tile')}, {plural(done.tiles, 'image')}, {size_text(done.bytes)}"
        click.echo(f"rendered {plural(done.done, 'block')} of {plural(len(result.renderings), 'rendering')}: {images}")
        for name in result.incomplete:
            click.echo(f"{name} is incomplete; see map3d jobs {name}", err=True)
    if result.incomplete:
        raise click.exceptions.Exit(1)
