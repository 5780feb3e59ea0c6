"""map3d jobs repair."""

import secrets

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import counts_text, plural, print_json
from map3d.cli.progress import progress_bar, show_stage


@click.command("repair")
@click.argument("rendering")
@click.option("--sample", type=click.IntRange(1), help="Also render this many blocks again and compare their bytes.")
@click.option("--deep", is_flag=True, help="Also render all blocks again and compare their bytes.")
@click.option("--seed", type=click.IntRange(0), help="Seed of the choice of --sample.  [default: random; printed]")
@json_option
@workspace_option
def command(workspace: Workspace, rendering: str, sample: int | None, deep: bool, seed: int | None, as_json: bool) -> None:
    """Verify RENDERING, and open the blocks again that are wrong or missing.

    Wrong blocks are removed from the tile store. The next map3d render RENDERING renders them and the blocks above them.
    """
    from map3d.verify.repair import repair

    seed = secrets.randbelow(1 << 32) if seed is None else seed
    if sample and not deep:
        click.echo(f"choosing {plural(sample, 'block')} with seed {seed}", err=True)
    catalogue = workspace.open_catalogue()
    try:
        with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()) as bar:
            task = bar.add_task("verifying", total=None)

            def progress(stage: str, done: int, total: int) -> None:
                show_stage(bar, task, stage, done, total)

            result = repair(workspace, catalogue, rendering, progress, sample=sample, deep=deep, seed=seed)
    finally:
        catalogue.close()
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
