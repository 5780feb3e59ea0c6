"""map3d jobs: a group whose default command shows progress."""

import json
import re
import secrets
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import click
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.from_request import request_option
from map3d.cli.job_tables import Detail, Overview, load_progress
from map3d.cli.options import json_option, workspace_option
from map3d.cli.ordered_group import OrderedGroup
from map3d.cli.output import counts_text, plural, print_json, size_text
from map3d.cli.progress import progress_bar, show_stage
from map3d.errors import FAILED
from map3d.requests.scenes import WorkLimits
from map3d.types import BlockId

if TYPE_CHECKING:
    from map3d.jobs.reproduce import Reproduction

_WIDTH: Final = 160
"""Table width when stdout is not a terminal."""


class JobCommands(OrderedGroup):
    """`map3d jobs [RENDERING]` means `map3d jobs show [RENDERING]`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args or (args[0] not in self.commands and args[0] not in ctx.help_option_names):
            args = ["show", *args]
        return super().parse_args(ctx, args)


@click.group("jobs", cls=JobCommands, subcommand_metavar="[RENDERING] [OPTIONS] | COMMAND [ARGS]...")
def command() -> None:
    """Show progress, workers and failures; retry, cancel, repair and reproduce blocks.

    \b
    map3d jobs                   all renderings in one table
    map3d jobs RENDERING         one rendering; the same as map3d jobs show RENDERING
    map3d jobs RENDERING --watch keep the display up to date
    """


@command.command("show")
@click.argument("rendering", required=False)
@click.option("--watch", is_flag=True, help="Refresh until no block is left to render; in a pipe, print one line per refresh.")
@click.option("--every", type=click.FloatRange(min=0.1), default=2.0, show_default=True, help="Seconds between refreshes of --watch.")
@json_option
@workspace_option
def show(workspace: Workspace, rendering: str | None, watch: bool, every: float, as_json: bool) -> None:
    """Show the progress of RENDERING, its workers and its failures; without RENDERING, all renderings in one table."""
    with workspace.open_catalogue() as catalogue:
        if watch:
            _watch(catalogue, rendering, every, as_json)
            return
        view = load_progress(catalogue, rendering)
        if as_json:
            print_json(view.document())
        else:
            _console().print(view.display())


def _watch(catalogue: Catalogue, rendering: str | None, every_s: float, as_json: bool) -> None:
    if as_json or not Console().is_terminal:
        for view in _refreshes(catalogue, rendering, every_s):
            click.echo(json.dumps(view.document(), default=str) if as_json else view.line())
        return
    with Live(console=_console(), auto_refresh=False) as live:
        for view in _refreshes(catalogue, rendering, every_s):
            live.update(view.display(), refresh=True)


def _refreshes(catalogue: Catalogue, rendering: str | None, every_s: float) -> "Iterator[Overview | Detail]":
    """Yields the state until nothing is left to render. Reading it takes at most a tenth of the time, however many blocks there are."""
    while True:
        started_s = time.monotonic()
        view = load_progress(catalogue, rendering)
        yield view
        if not view.has_open_jobs:
            return
        time.sleep(max(every_s, 9 * (time.monotonic() - started_s)))


def _console() -> Console:
    return Console(highlight=False, width=None if Console().is_terminal else _WIDTH)


@command.command("retry")
@click.argument("rendering")
@json_option
@workspace_option
def retry(workspace: Workspace, rendering: str, as_json: bool) -> None:
    """Allow three more attempts for the quarantined blocks of RENDERING, and open its cancelled blocks again."""
    with workspace.open_catalogue() as catalogue:
        count = catalogue.retry(rendering)
    if as_json:
        print_json({"retried": count})
    else:
        click.echo(f"reopened {plural(count, 'block')}" + (f"; next: map3d render {rendering}" if count else ""))


@command.command("cancel")
@click.argument("rendering")
@json_option
@workspace_option
def cancel(workspace: Workspace, rendering: str, as_json: bool) -> None:
    """Cancel the open blocks of RENDERING, also those that workers render now.

    Rendered tiles stay. map3d render RENDERING and map3d jobs retry RENDERING open the cancelled blocks again.
    """
    with workspace.open_catalogue() as catalogue:
        count = catalogue.cancel(rendering)
    if as_json:
        print_json({"cancelled": count})
    else:
        click.echo(f"cancelled {plural(count, 'block')}" + (f"; to resume: map3d render {rendering}" if count else ""))


@command.command("repair")
@click.argument("rendering")
@click.option("--sample", type=click.IntRange(1), help="Also render this many blocks again and compare their bytes.")
@click.option("--deep", is_flag=True, help="Also render all blocks again and compare their bytes.")
@click.option("--seed", type=click.IntRange(0), help="Seed of the choice of --sample.  [default: random; printed]")
@json_option
@workspace_option
def repair_rendering(workspace: Workspace, rendering: str, sample: int | None, deep: bool, seed: int | None, as_json: bool) -> None:
    """Verify RENDERING, and open the blocks again that are wrong or missing.

    Wrong blocks are removed from the tile store. The next map3d render RENDERING renders them and the blocks above them.
    """
    from map3d.verify.repair import repair

    seed = secrets.randbelow(1 << 32) if seed is None else seed
    if sample and not deep:
        click.echo(f"choosing {plural(sample, 'block')} with seed {seed}", err=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with workspace.open_catalogue() as catalogue, progress_bar(*columns) as bar:
        task = bar.add_task("verifying", total=None)

        def progress(stage: str, done: int, total: int) -> None:
            show_stage(bar, task, stage, done, total)

        result = repair(workspace, catalogue, rendering, progress, sample=sample, deep=deep, seed=seed)
    if as_json:
        wrong = [{"track": track, "block": block} for track, block in result.wrong]
        print_json({"problems": result.findings.wrong, "total": result.findings.total, "wrong": wrong, "reopened": result.reopened})
        return
    click.echo(f"checked {counts_text(result.findings.counted)}")
    for line in result.findings.wrong:
        click.echo(line)
    if not result.findings.total:
        click.echo("no problems found")
        return
    blocks = f"{plural(len(result.wrong), 'block')} wrong or missing, {plural(result.reopened, 'block')} opened again"
    click.echo(f"{plural(result.findings.total, 'problem')} found: {blocks}; next: map3d render {rendering}")


class Block(click.ParamType):  # type: ignore[type-arg]
    """A block by its root tile, e.g. 5/3/7."""

    name = "block"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> BlockId:
        match = re.fullmatch(r"([0-9]{1,2})/([0-9]{1,9})/([0-9]{1,9})", str(value))
        if match is None:
            self.fail(f"{value!r} is not a block; write level, column and row as in 5/3/7", param, ctx)
        return BlockId(*(int(number) for number in match.groups()))


@command.command("reproduce")
@click.argument("rendering")
@click.argument("block", type=Block())
@click.option("--track", help="Track of the block, as map3d jobs shows it.  [default: those in which the block is in quarantine]")
@click.option("--timeout", type=click.FloatRange(min=0, min_open=True), help="Seconds that the block may take.  [default: 900, as in a render]")
@request_option(WorkLimits, "max_memory_bytes")
@json_option
@workspace_option
def reproduce_block(
    workspace: Workspace, rendering: str, block: BlockId, track: str | None, timeout: float | None, max_memory_bytes: int | None, as_json: bool
) -> None:
    """Render one BLOCK of RENDERING alone, as a worker would, and print what happens.

    Stores nothing and leaves the block's state as it is. Exits with status 1 unless the block was rendered.
    """
    from map3d.jobs.reproduce import reproduce
    from map3d.jobs.run_settings import RunSettings

    settings = RunSettings(1, max_memory_bytes)
    if timeout is not None:
        settings = replace(settings, timeouts=replace(settings.timeouts, block_s=timeout))
    with workspace.open_catalogue() as catalogue:
        found = reproduce(workspace, catalogue, rendering, block, settings, track)
    if as_json:
        print_json(found)
    else:
        for item in found:
            _print_reproduction(item)
    if not all(item.is_done for item in found):
        raise click.exceptions.Exit(FAILED)


def _print_reproduction(item: "Reproduction") -> None:
    click.echo(f"{item.track} {item.block} ({item.kind}, {item.state}): {item.outcome} after {item.seconds:.2f} s" + _memory(item.peak_bytes))
    if item.reason:
        click.echo(f"  reason: {item.reason}")
    if item.signal:
        click.echo(f"  ended by {item.signal}")
    if item.is_done:
        levels = ", ".join(f"{count} on level {level}" for level, count in item.tiles.items())
        click.echo(f"  {plural(sum(item.tiles.values()), 'image')}, {size_text(item.bytes)}" + (f": {levels}" if levels else ""))
    for line in item.output:
        click.echo(f"  | {line}")


def _memory(peak_bytes: int) -> str:
    return f", {size_text(peak_bytes)} of memory at its peak" if peak_bytes else ""
