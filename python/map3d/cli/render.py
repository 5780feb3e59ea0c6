"""map3d render."""

import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from map3d.catalogue import Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.options import json_option, max_memory_option, workers_option, workspace_option
from map3d.cli.output import console, counts_text, print_json, size_text
from map3d.cli.progress import progress_bar
from map3d.cli.render_stats import print_summary, summary

if TYPE_CHECKING:
    from map3d.jobs.run import Outcome, Plan, Run


@click.command("render")
@click.argument("rendering")
@workers_option
@max_memory_option
@click.option("--stats", "with_stats", is_flag=True, help="Say at the end where the time went and how often the caches had what was asked for.")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, workers: int, max_memory: int | None, with_stats: bool, as_json: bool) -> None:
    """Make the tiles of RENDERING: what is missing or has changed.

    It may be stopped at any time, even by killing it; the same command goes on where it was. Ctrl-C lets the blocks in hand be finished, a
    second Ctrl-C gives them back at once.
    """
    from map3d.jobs.run import Run, Settings

    catalogue = workspace.open_catalogue()
    try:
        settings = Settings(workers, max_memory)
        scene = catalogue.rendering(rendering).scene
        built = build_with_progress(workspace, catalogue, scene, threads=workers, max_memory_bytes=max_memory)
        outcome = render_with_progress(Run(workspace, catalogue, rendering, settings))
    finally:
        catalogue.close()
    if as_json:
        print_json({**asdict(outcome), "stats": summary(outcome.stats) if with_stats else None, "build": built})
    else:
        report(rendering, outcome)
        if with_stats:
            print_summary(summary(outcome.stats))
    if not outcome.complete:
        raise click.exceptions.Exit(130 if outcome.stopped else 1)


def render_with_progress(run: "Run") -> "Outcome":
    """Plan and work, each with its bar on standard error."""
    with _bar(MofNCompleteColumn()) as bar:
        task = bar.add_task("planning", total=None)
        plan = run.plan(lambda done, total: bar.update(task, completed=done, total=total))
    return _work(run, plan)


def _work(run: "Run", plan: "Plan") -> "Outcome":
    from map3d.jobs.events import Done, Failed, Left, Lost, Stopping, Waiting

    note = console()
    outcome = plan.outcome
    note.print(f"blocks: {counts_text({'new': outcome.added, 'changed': outcome.changed, 'unchanged': outcome.kept})}; {plan.open_jobs:,} to do")
    begun, seen = time.monotonic(), {"base": 0}
    with _bar(TextColumn("{task.fields[rate]}")) as bar:
        task = bar.add_task("rendering", total=plan.open_jobs, rate="")

        def on_event(event: Any) -> None:
            if isinstance(event, Done):
                seen["base"] += event.result.base_tiles
                rate = seen["base"] / max(time.monotonic() - begun, 1e-3)
                bar.update(task, advance=1, rate=f"{rate:,.0f} base tiles/s")
            elif isinstance(event, Failed):
                bar.console.print(f"{event.lease.track} {event.lease.block}: attempt {event.lease.attempt} failed, now {event.state}: {event.reason}")
            elif isinstance(event, Lost):
                bar.console.print(f"{event.lease.track} {event.lease.block}: lease lost: {event.reason}")
            elif isinstance(event, Stopping):
                how = "giving the blocks in hand back" if event.abandoning else "finishing the blocks in hand; Ctrl-C again gives them back at once"
                bar.console.print(f"stopping: {how}")
            elif isinstance(event, Waiting):
                bar.console.print(f"waiting: {event.jobs:,} blocks are in other hands; of a render that was killed they come free within a minute")
            elif isinstance(event, Left) and event.because:
                bar.console.print(f"worker {event.worker} left: {event.because}")

        return run.work(plan, on_event)


def report(rendering: str, outcome: "Outcome") -> None:
    tally = outcome.tally
    click.echo(f"{tally.done:,} blocks done: {tally.base_tiles:,} base tiles, {tally.tiles:,} images, {size_text(tally.bytes)}")
    if outcome.complete:
        click.echo(f"{rendering} is complete (content version {outcome.content_version}); next: map3d serve, or map3d publish {rendering} -o FOLDER")
        return
    if outcome.quarantined_jobs:
        click.echo(
            f"{outcome.quarantined_jobs:,} blocks failed three times; see map3d show quarantine {rendering}, then map3d retry {rendering}", err=True
        )
    if outcome.open_jobs:
        click.echo(f"{outcome.open_jobs:,} blocks are still to do; go on with: map3d render {rendering}", err=True)


def _bar(last: Any) -> Progress:
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), last, TimeElapsedColumn(), TimeRemainingColumn())
    return progress_bar(*columns)
