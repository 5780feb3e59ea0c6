"""map3d site."""

from pathlib import Path
from typing import Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.create_rendering import around
from map3d.cli.options import View, max_memory_option, workers_option, workspace_option
from map3d.cli.output import size_text
from map3d.cli.progress import progress_bar
from map3d.cli.publish import publish_with_progress
from map3d.cli.render import print_result, render_with_progress
from map3d.types import COLOR_FORMATS, ViewAngles


@click.command("site")
@click.argument("folder", type=click.Path(path_type=Path, exists=True))
@click.option("-o", "--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Folder for the finished site.")
@click.option("--name", help="Of scene and rendering.  [default: the folder's]")
@click.option("--title", help="What people read.  [default: the folder's name]")
@click.option("--attribution", default="", help="Whom to credit on the map.")
@click.option(
    "--view", "views", type=View(), multiple=True, help="A view as look-at/pitch, e.g. 45/22.5; more than once.  [default: 4 around, pitch 45]"
)
@click.option("--res", "res_m", type=float, help="Metres a pixel.  [default: by the size of the scene, so that it takes minutes]")
@click.option("--color", type=click.Choice(list(COLOR_FORMATS)), default="webp", show_default=True, help="Format of the colour layer.")
@click.option("--crs", help="The files' coordinate system, where they do not say.")
@click.option("--up", type=click.Choice(["y", "z"]), default="z", show_default=True, help="OBJ: the axis that points up.")
@click.option("--strict", is_flag=True, help="Stop at the first fault.")
@workers_option
@max_memory_option
@workspace_option
def command(
    workspace: Workspace, folder: Path, out: Path, views: tuple[ViewAngles, ...], workers: int, max_memory: int | None, **options: Any
) -> None:
    """Make a site of all files in FOLDER: import, build, render, publish.

    Stopped at any point, the same command goes on; run again after files have changed, it does only what changed.
    """
    from map3d.ingest.import_options import ImportOptions
    from map3d.ingest.sources import asset_name
    from map3d.jobs.run import Run, RunSettings
    from map3d.renderings.site_steps import SiteRequest, add_changed, make_rendering

    title = options["title"] or folder.resolve().stem
    reading = ImportOptions(crs=options["crs"], up=options["up"], strict=options["strict"])
    request = SiteRequest(
        name=options["name"] or asset_name(folder.resolve().stem),
        sources=folder,
        views=views or around(4, (45.0,)),
        res_m=options["res_m"],
        title=title,
        attribution=options["attribution"],
        color=options["color"],
        options=reading,
    )
    catalogue = workspace.create().open_catalogue()
    try:
        with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()) as bar:
            task = bar.add_task("importing", total=None)
            added = add_changed(
                workspace, catalogue, request, lambda name, n, of: bar.update(task, description=f"importing {name}", completed=n, total=of)
            )
        click.echo(f"{len(added.imported)} files imported, {len(added.unchanged)} unchanged, {len(added.failed)} not usable")
        for _, reason in added.failed:
            click.echo(f"not added: {reason}", err=True)
        _tell_faults(catalogue, request.name)
        build_with_progress(workspace, catalogue, request.name, threads=workers, max_memory_bytes=max_memory)
        record = make_rendering(workspace, catalogue, request)
        click.echo(f"rendering {record.name}: {len(record.frames)} views, {record.zmax + 1} levels, {record.res_m:g} m a pixel")
        outcome = render_with_progress(Run(workspace, catalogue, record.name, RunSettings(workers, max_memory)))
    finally:
        catalogue.close()
    print_result(record.name, outcome)
    if not outcome.complete:
        raise click.exceptions.Exit(130 if outcome.stopped else 1)
    done = publish_with_progress(workspace, record.name, out, replace=True)
    click.echo(f"the site is in {out}, {size_text(done.bytes)}; copy it to any web server that answers range requests")


def _tell_faults(catalogue: Catalogue, scene: str) -> None:
    """How much in the files was skipped or is worth a look."""
    reports = [asset.report for asset in catalogue.assets(scene)]
    skipped = sum(sum(report.get("skipped", {}).values()) for report in reports)
    noted = sum(warning["count"] for report in reports for warning in report.get("warnings", []) if not warning["reason"].startswith("skipped: "))
    if skipped or noted:
        click.echo(f"{skipped:,} things in the files were skipped, {noted:,} noted; map3d show report {scene} tells which")
