"""map3d jobs reproduce."""

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, max_memory_option, workspace_option
from map3d.cli.output import plural, print_json, size_text
from map3d.types import BlockId

if TYPE_CHECKING:
    from map3d.jobs.reproduce import Reproduction


class Block(click.ParamType):  # type: ignore[type-arg]
    """A block by its root tile, e.g. 5/3/7."""

    name = "block"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> BlockId:
        match = re.fullmatch(r"([0-9]{1,2})/([0-9]{1,9})/([0-9]{1,9})", str(value))
        if match is None:
            self.fail(f"{value!r} is not a block; write level, column and row as in 5/3/7", param, ctx)
        return BlockId(*(int(number) for number in match.groups()))


@click.command("reproduce")
@click.argument("rendering")
@click.argument("block", type=Block())
@click.option("--track", help="Track of the block, as map3d jobs shows it.  [default: those in which the block is in quarantine]")
@click.option("--timeout", type=click.FloatRange(min=0, min_open=True), help="Seconds that the block may take.  [default: 900, as in a render]")
@max_memory_option
@json_option
@workspace_option
def command(
    workspace: Workspace, rendering: str, block: BlockId, track: str | None, timeout: float | None, max_memory: int | None, as_json: bool
) -> None:
    """Render one BLOCK of RENDERING alone, as a worker would, and print what happens.

    Stores nothing and leaves the block's state as it is. Exits with status 1 unless the block was rendered.
    """
    from map3d.jobs.reproduce import reproduce
    from map3d.jobs.run_settings import RunSettings

    settings = RunSettings(1, max_memory)
    if timeout is not None:
        settings = replace(settings, timeouts=replace(settings.timeouts, block_s=timeout))
    catalogue = workspace.open_catalogue()
    try:
        found = reproduce(workspace, catalogue, rendering, block, settings, track)
    finally:
        catalogue.close()
    if as_json:
        print_json(found)
    else:
        for item in found:
            _print(item)
    if not all(item.is_done for item in found):
        raise click.exceptions.Exit(1)


def _print(item: "Reproduction") -> None:
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
