"""map3d verify."""

import secrets
from pathlib import Path

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from map3d.catalogue import Workspace
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import counts_text, plural, print_json
from map3d.cli.progress import progress_bar, show_stage
from map3d.errors import FAILED


@click.command("verify")
@click.argument("renderings", nargs=-1)
@click.option("--published", type=click.Path(path_type=Path, exists=True, file_okay=False), help="Verify a published folder instead.")
@click.option("--sample", type=click.IntRange(1), help="Also render this many blocks of each rendering again and compare their bytes.")
@click.option("--deep", is_flag=True, help="Also render all blocks again and compare their bytes.")
@click.option("--seed", type=click.IntRange(0), help="Seed of the choice of --sample.  [default: random; printed]")
@json_option
@workspace_option
def command(
    workspace: Workspace, renderings: tuple[str, ...], published: Path | None, sample: int | None, deep: bool, seed: int | None, as_json: bool
) -> None:
    """Verify RENDERINGS, or all renderings and scenes.

    Compares files with checksums and blocks with the plan, and checks every tile, seam and id. Lists the problems found and exits with status 1
    if there are any.
    """
    if published is not None:
        _verify_published(published, as_json)
        return
    from map3d.verify.findings import Findings
    from map3d.verify.pixel_checks import verify_pixels
    from map3d.verify.rendering_checks import verify_rendering, verify_scene

    seed = secrets.randbelow(1 << 32) if seed is None else seed
    if sample and not deep:
        click.echo(f"choosing {plural(sample, 'block')} with seed {seed}", err=True)

    findings = Findings()
    with workspace.open_catalogue() as catalogue:
        chosen = [catalogue.rendering(name) for name in renderings] or catalogue.renderings()
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with progress_bar(*columns) as bar:
            task = bar.add_task("verifying", total=None)

            def progress(stage: str, done: int, total: int) -> None:
                show_stage(bar, task, stage, done, total)

            scenes = {record.scene for record in chosen} if renderings else {scene.name for scene in catalogue.scenes()}
            for scene in sorted(scenes):
                verify_scene(workspace, catalogue, scene, findings, progress)
            for record in chosen:
                verify_rendering(workspace, catalogue, record.name, findings, progress)
                if deep or sample:
                    verify_pixels(workspace, catalogue, record.name, findings, progress, sample=None if deep else sample, seed=seed)
    if as_json:
        print_json({"wrong": findings.wrong, "total": findings.total, "counted": findings.counted})
    else:
        click.echo(f"checked {counts_text(findings.counted)}")
        for line in findings.wrong:
            click.echo(line)
        click.echo(f"{plural(findings.total, 'problem')} found" if findings.total else "no problems found")
    if findings.total:
        raise click.exceptions.Exit(FAILED)


def _verify_published(folder: Path, as_json: bool) -> None:
    from map3d.verify.published_checks import verify_published

    found = verify_published(folder)
    if as_json:
        print_json(found)
    else:
        click.echo(f"{folder}: no problems found")
