"""map3d site."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.create_rendering import views_around
from map3d.cli.options import View, max_memory_option, workers_option, workspace_option
from map3d.cli.output import names_text, plural, size_text
from map3d.cli.progress import progress_bar
from map3d.cli.publish import publish_with_progress
from map3d.cli.render import print_result, render_with_progress
from map3d.types import COLOR_FORMATS, ViewAngles

if TYPE_CHECKING:
    from map3d.renderings.site_files import ImportSummary
    from map3d.renderings.site_steps import SiteRequest


@click.command("site")
@click.argument("folder", type=click.Path(path_type=Path, exists=True))
@click.option("-o", "--out", type=click.Path(path_type=Path, file_okay=False), required=True, help="Output folder of the site.")
@click.option("--name", help="Name of scene and rendering.  [default: from the folder]")
@click.option("--title", help="Display title.  [default: name of the folder]")
@click.option("--attribution", default="", help="Attribution text.")
@click.option(
    "--view",
    "views",
    type=View(),
    multiple=True,
    help="Look-at angle and pitch, e.g. 45-22.5; repeatable.  [default: 4 angles, pitch 45]",
)
@click.option("--res", "res_m", type=float, help="Metres per pixel.  [default: depends on the size of the scene, so that rendering takes minutes]")
@click.option("--color", type=click.Choice(list(COLOR_FORMATS)), default="webp", show_default=True, help="Image format of the layer color.")
@click.option("--crs", help="Coordinate system of the files, where they do not state it.")
@click.option("--up", type=click.Choice(["y", "z"]), default="z", show_default=True, help="OBJ: the axis that points up.")
@click.option("--strict", is_flag=True, help="Stop at the first problem instead of skipping it.")
@click.option("--allow-empty", is_flag=True, help="Remove files from the site even if the folder that they came from is empty now.")
@workers_option
@max_memory_option
@workspace_option
def command(
    workspace: Workspace, folder: Path, out: Path, views: tuple[ViewAngles, ...], workers: int, max_memory: int | None, **options: Any
) -> None:
    """Turn all files in FOLDER into a static web site: import, build, render, publish.

    You can stop it at any time; re-run it to resume. Re-run it after files change; only the changes are processed. Files that have left FOLDER leave
    the site; files are imported again when they, the options or the reader change.
    """
    from map3d.jobs.run import Run
    from map3d.jobs.run_settings import RunSettings
    from map3d.publish import check_folder
    from map3d.renderings.site_steps import create_site_rendering

    check_folder(out)
    request = _site_request(folder, views, **options)
    catalogue = workspace.create().open_catalogue()
    try:
        _update_files(workspace, catalogue, request)
        if not catalogue.assets(request.name):
            click.echo(f"the scene {request.name} has no files left; {out} stays as it was published")
            return
        build_with_progress(workspace, catalogue, request.name, threads=workers, max_memory_bytes=max_memory)
        record = create_site_rendering(workspace, catalogue, request)
        click.echo(f"rendering {record.name}: {plural(len(record.frames), 'view')}, {plural(record.zmax + 1, 'level')}, {record.res_m:g} m per pixel")
        result = render_with_progress(Run(workspace, catalogue, record.name, RunSettings(workers, max_memory)))
    finally:
        catalogue.close()
    print_result(record.name, result)
    if not result.complete:
        raise click.exceptions.Exit(130 if result.stopped else 1)
    done = publish_with_progress(workspace, record.name, out, replace=True)
    click.echo(f"wrote the site to {out}, {size_text(done.bytes)}; copy it to any web server that supports range requests")


def _site_request(folder: Path, views: tuple[ViewAngles, ...], **options: Any) -> "SiteRequest":
    from map3d.ingest.import_options import ImportOptions
    from map3d.ingest.sources import asset_name
    from map3d.renderings.site_steps import SiteRequest

    folder_name = folder.resolve().stem
    return SiteRequest(
        name=options["name"] or asset_name(folder_name),
        sources=folder,
        views=views or views_around(4, (45.0,)),
        res_m=options["res_m"],
        title=options["title"] or folder_name,
        attribution=options["attribution"],
        color=options["color"],
        options=ImportOptions(crs=options["crs"], up=options["up"], strict=options["strict"]),
        allow_empty=options["allow_empty"],
    )


def _update_files(workspace: Workspace, catalogue: Catalogue, request: "SiteRequest") -> None:
    from map3d.renderings.site_files import update_files

    with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()) as bar:
        task = bar.add_task("importing", total=None)

        def report(name: str, done: int, total: int) -> None:
            bar.update(task, description=f"importing {name}", completed=done, total=total)

        summary = update_files(workspace, catalogue, request.files, report)
    _print_summary(summary)
    _print_problems(catalogue, request.name)


def _print_summary(summary: "ImportSummary") -> None:
    from map3d.renderings.site_files import reasons

    counts = f"{len(summary.unchanged)} unchanged, {len(summary.failed)} failed, {len(summary.removed)} removed"
    click.echo(f"imported {plural(len(summary.imported), 'file')}, {counts}")
    for reason, names in reasons(summary.again).items():
        click.echo(f"imported again because {reason}: {names_text(names)}")
    if summary.removed:
        click.echo(f"removed, since no longer in the folder: {names_text(summary.removed)}")
    if summary.elsewhere:
        click.echo(f"kept, since not from this folder: {names_text(summary.elsewhere)}; map3d remove-files removes them")
    for _, reason in summary.failed:
        click.echo(f"not imported: {reason}", err=True)


def _print_problems(catalogue: Catalogue, scene: str) -> None:
    """Prints how many elements were skipped, and the number of warnings."""
    reports = [asset.report for asset in catalogue.assets(scene)]
    skipped = sum(sum(report.get("skipped", {}).values()) for report in reports)
    warnings = sum(warning["count"] for report in reports for warning in report.get("warnings", []) if not warning["reason"].startswith("skipped: "))
    if skipped or warnings:
        click.echo(f"skipped {plural(skipped, 'element')}; {plural(warnings, 'warning')}; map3d show report {scene} lists them")
