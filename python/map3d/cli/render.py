"""map3d render."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import click
from rich.progress import MofNCompleteColumn

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.from_request import request_options
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import plural, print_json, size_text
from map3d.cli.render_stats import print_summary, summary
from map3d.errors import FAILED, INTERRUPTED
from map3d.requests import Render

if TYPE_CHECKING:
    from map3d.jobs.dask.pool import DaskPools
    from map3d.jobs.run import Run, RunPlan, RunResult
    from map3d.jobs.run_settings import RunSettings


@click.command("render")
@click.argument("rendering")
@request_options(Render)
@click.option("--stats", "with_stats", is_flag=True, help="Print the time spent in each stage and the hit rates of the caches.")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, request: Render, with_stats: bool, as_json: bool) -> None:
    """Render the missing and changed tiles of RENDERING.

    You can stop it at any time, even with kill; re-run it to resume. Ctrl-C finishes the current blocks first; a second Ctrl-C releases them
    and stops at once. map3d work helps from other processes and nodes.

    With --dask, the scene is built and the blocks are planned here; every thread of the Dask workers renders with a subprocess of its own. The
    cluster decides how many there are; --workers and --max-memory apply to the build, and --max-memory to each Dask worker's thread.

    With --plan-only, the blocks are left to map3d work, or to map3d serve --on-demand, which renders those that are looked at.
    """
    from map3d.jobs.run import Run
    from map3d.jobs.run_settings import RunSettings

    with workspace.open_catalogue() as catalogue:
        workers, memory = request.processes, request.max_memory_bytes
        settings = RunSettings(workers, memory)
        scene = catalogue.rendering(rendering).scene
        built = build_with_progress(workspace, catalogue, scene, threads=workers, max_memory_bytes=memory)
        if request.plan_only:
            plan = plan_with_progress(Run(workspace, catalogue, rendering, settings))
            print_plan(rendering, plan, as_json)
            return
        with _dask_pools(workspace, catalogue, settings, request.dask, request.dask_workspace) as pools:
            result = render_with_progress(Run(workspace, catalogue, rendering, settings, pools))
    if as_json:
        print_json({**asdict(result), "stats": summary(result.stats) if with_stats else None, "build": built})
    else:
        print_result(rendering, result)
        if with_stats:
            print_summary(summary(result.stats))
    if not result.complete:
        raise click.exceptions.Exit(INTERRUPTED if result.stopped else FAILED)


def _dask_pools(
    workspace: Workspace, catalogue: Catalogue, settings: "RunSettings", address: str | None, folder: str | None
) -> "AbstractContextManager[DaskPools | None]":
    """Returns a context without value when there is no `address`."""
    if address is None:
        return nullcontext()
    from map3d.jobs.dask.pool import DaskPools

    return DaskPools(address, workspace, catalogue, replace(settings, workers=1), folder)


def render_with_progress(run: "Run") -> "RunResult":
    """Plans and runs the jobs, with a progress bar for each on standard error."""
    from map3d.cli.run_progress import RunProgress

    plan = plan_with_progress(run)
    with RunProgress() as progress:
        return run.work(plan, progress)


def plan_with_progress(run: "Run") -> "RunPlan":
    from map3d.cli.run_progress import run_bar

    with run_bar(MofNCompleteColumn()) as bar:
        task = bar.add_task("planning", total=None)
        return run.plan(lambda done, total: bar.update(task, completed=done, total=total))


def print_plan(rendering: str, plan: "RunPlan", as_json: bool) -> None:
    if as_json:
        print_json(
            {"counts": asdict(plan.counts), "open_jobs": plan.open_jobs, "done_jobs": plan.done_jobs, "quarantined_jobs": plan.quarantined_jobs}
        )
        return
    click.echo(f"planned {rendering}: {plural(plan.open_jobs, 'block')} to render, {plural(plan.done_jobs, 'block')} done")
    if plan.open_jobs:
        click.echo(f"next: map3d serve {rendering} --on-demand, or map3d render {rendering}")


def print_result(rendering: str, result: "RunResult") -> None:
    done = result.statistics
    tiles = f"{plural(done.base_tiles, 'base tile')}, {plural(done.tiles, 'image')}"
    click.echo(f"rendered {plural(done.done, 'block')}: {tiles}, {size_text(done.bytes)}")
    if result.complete:
        version = result.content_version
        click.echo(f"{rendering} is complete (content version {version}); next: map3d serve {rendering}, or map3d publish {rendering} -o FOLDER")
        return
    if result.quarantined_jobs:
        click.echo(
            f"{plural(result.quarantined_jobs, 'block')} are in quarantine; run map3d show quarantine {rendering} for the reasons, "
            f"then map3d retry {rendering}",
            err=True,
        )
    if result.open_jobs:
        click.echo(f"remaining: {plural(result.open_jobs, 'block')}; resume with map3d render {rendering}", err=True)
