"""map3d site."""

from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.import_reports import left_alone_lines, missing_textures_line, place_line, warning_lines
from map3d.cli.layer_options import data_option, small_option
from map3d.cli.options import View, format_options, max_memory_option, outlier_options, style_option, workers_option, workspace_option
from map3d.cli.output import names_text, plural, size_text
from map3d.cli.progress import progress_bar
from map3d.cli.publish import publish_with_progress
from map3d.cli.render import print_result, render_with_progress
from map3d.geometry.views import views_around
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
@click.option(
    "--res",
    "res_m",
    type=float,
    help="Metres per pixel.  [default: as fine as textures and triangles, coarser for large scenes, so that rendering takes minutes]",
)
@click.option("--color", type=click.Choice(list(COLOR_FORMATS)), default="webp", show_default=True, help="Image format of the layer color.")
@data_option()
@small_option
@click.option("--crs", help="Coordinate system of the files, where they do not state it or state it wrongly; 'local' for local metres.")
@format_options
@click.option("--strict", is_flag=True, help="Stop at the first problem instead of skipping it.")
@click.option("--allow-empty", is_flag=True, help="Remove files from the site even if the folder that they came from is empty now.")
@outlier_options
@style_option
@click.option("--ao/--no-ao", default=None, help="Render ambient occlusion.  [default: where textures cover less than a tenth]")
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
    from map3d.cli.site_extents import print_estimate, print_extents, print_rendering
    from map3d.jobs.run import Run
    from map3d.jobs.run_settings import RunSettings
    from map3d.publish import check_folder
    from map3d.publish.report_page import REPORT_PAGE
    from map3d.renderings.outliers import choose_content
    from map3d.renderings.site_steps import create_site_rendering, store_report
    from map3d.renderings.style import choose_style

    check_folder(out)
    settings = RunSettings(workers, max_memory)
    settings.check()
    request = _site_request(folder, views, **options)
    with workspace.create().open_catalogue() as catalogue:
        summary = _update_files(workspace, catalogue, request)
        if not catalogue.assets(request.name):
            click.echo(f"the scene {request.name} has no files left; {out} stays as it was published")
            return
        choose_content(catalogue, request.name, request.keep_outliers, request.cluster)
        choose_style(catalogue, request.name, request.style)
        built = build_with_progress(workspace, catalogue, request.name, threads=workers, max_memory_bytes=max_memory)
        print_extents(workspace, catalogue, request.name, was_built=built is not None)
        made = create_site_rendering(workspace, catalogue, request)
        record = made.record
        print_rendering(made)
        print_estimate(workspace, catalogue, record.name, workers)
        started = monotonic()
        result = render_with_progress(Run(workspace, catalogue, record.name, settings))
        seconds = monotonic() - started if result.statistics.done else None
        store_report(workspace, catalogue, request, made, summary, workers, seconds)
    print_result(record.name, result)
    if not result.complete:
        raise click.exceptions.Exit(130 if result.stopped else 1)
    done = publish_with_progress(workspace, record.name, out, replace=True)
    click.echo(f"wrote the site to {out}, {size_text(done.bytes)}; copy it to any web server that supports range requests")
    click.echo(f"report: {out / REPORT_PAGE} says what the files hold and what was skipped")


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
        data=options["data"],
        small=options["small"],
        options=ImportOptions(
            **{name: options[name] for name in ("crs", "up", "split", "theme", "lod", "interiors", "transparency", "max_error_m", "strict")},
            virtual_rasters=True,
        ),
        allow_empty=options["allow_empty"],
        keep_outliers=bool(options["keep_outliers"]),
        cluster=options["cluster"] or 0,
        style=options["style"] or [],
        ao=options["ao"],
    )


def _update_files(workspace: Workspace, catalogue: Catalogue, request: "SiteRequest") -> "ImportSummary":
    from map3d.renderings.site_files import update_files

    with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()) as bar:
        task = bar.add_task("importing", total=None)

        def report(name: str, done: int, total: int, how_far: str) -> None:
            bar.update(task, description=f"importing {name}: {how_far}" if how_far else f"importing {name}", completed=done, total=total)

        summary = update_files(workspace, catalogue, request.files, report)
    _print_summary(summary)
    _print_problems(workspace, catalogue, request.name)
    return summary


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
    for line in left_alone_lines(summary.left_alone):
        click.echo(line)
    for _, reason in summary.failed:
        click.echo(f"not imported: {reason}", err=True)


def _print_problems(workspace: Workspace, catalogue: Catalogue, scene: str) -> None:
    """Prints where the scene is, each kind of warning, how many elements were skipped, and the number of warnings."""
    by_asset = {asset.name: asset.report for asset in catalogue.assets(scene)}
    if by_asset and (place := place_line(workspace, catalogue, scene)) is not None:
        click.echo(place)
    if (line := missing_textures_line(by_asset)) is not None:
        click.echo(line)
    for line in warning_lines(by_asset):
        click.echo(line)
    reports = list(by_asset.values())
    skipped = sum(sum(report.get("skipped", {}).values()) for report in reports)
    warnings = sum(warning["count"] for report in reports for warning in report.get("warnings", []) if not warning["reason"].startswith("skipped: "))
    if skipped or warnings:
        click.echo(f"skipped {plural(skipped, 'element')}; {plural(warnings, 'warning')}; map3d show report {scene} lists them")
