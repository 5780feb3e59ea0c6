"""map3d site."""

from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING

import click
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.building import build_with_progress
from map3d.cli.from_request import request_options
from map3d.cli.import_reports import missing_textures_line, place_line, warning_lines
from map3d.cli.options import workspace_option
from map3d.cli.output import names_text, plural, size_text
from map3d.cli.progress import progress_bar
from map3d.cli.publish import publish_with_progress
from map3d.cli.render import print_result, render_with_progress
from map3d.errors import FAILED, IN_PART, INTERRUPTED
from map3d.ingest.file_notes import note_lines
from map3d.ingest.findings import failed_count, skipped_count, warning_count
from map3d.messages import Message
from map3d.requests import Site

if TYPE_CHECKING:
    from map3d.site.files import ImportSummary


@click.command("site")
@request_options(Site, folder={"type": click.Path(path_type=Path, exists=True)}, out={"type": click.Path(path_type=Path, file_okay=False)})
@workspace_option
def command(workspace: Workspace, request: Site) -> None:
    """Turn all files in FOLDER into a static web site: import, build, render, publish.

    You can stop it at any time; re-run it to resume. Re-run it after files change; only the changes are processed. Files that have left FOLDER leave
    the site; files are imported again when they, the options or the reader change. Exits with 3 if the site was published but files of FOLDER could
    not be read.
    """
    from map3d.cli.site_extents import print_estimate, print_extents, print_rendering
    from map3d.ingest.asset_names import asset_name
    from map3d.jobs.run import Run
    from map3d.jobs.run_settings import RunSettings
    from map3d.publish.folder_target import check_folder
    from map3d.publish.report_page import REPORT_PAGE
    from map3d.publish.target import MapIdentity
    from map3d.scenes.style import choose_style
    from map3d.site.steps import create_site_rendering, store_report
    from map3d.tiles.viewer_files import viewer_folder

    out, workers, memory = request.out, request.processes, request.max_memory_bytes
    settings = RunSettings(workers, memory)
    settings.check()
    request = replace(request, name=request.name or asset_name(request.folder.resolve().stem))
    viewer_folder()
    check_folder(out, MapIdentity(request.name), request.replace)
    with workspace.create().open_catalogue() as catalogue:
        summary = _update_files(workspace, catalogue, request)
        failed = len(summary.failed) + sum(failed_count(asset.report) for asset in catalogue.assets(request.name))
        if not catalogue.assets(request.name):
            click.echo(f"the scene {request.name} has no files left; {out} stays as it was published")
            return
        check_folder(out, MapIdentity(request.name, catalogue.scene(request.name).origin), request.replace)
        choose_style(catalogue, request.name, request.style or {"rules": []})
        built = build_with_progress(workspace, catalogue, request.name, threads=workers, max_memory_bytes=memory)
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
        raise click.exceptions.Exit(INTERRUPTED if result.stopped else FAILED)
    done = publish_with_progress(workspace, record.name, out, replace=request.replace)
    click.echo(f"wrote the site to {out}, {size_text(done.bytes)}; copy it to any web server that supports range requests")
    click.echo(f"report: {out / REPORT_PAGE} says what the files hold and what was skipped")
    if failed:
        click.echo(f"published, but {plural(failed, 'file')} could not be read, or not as a whole", err=True)
        raise click.exceptions.Exit(IN_PART)


def _update_files(workspace: Workspace, catalogue: Catalogue, request: Site) -> "ImportSummary":
    from map3d.scenes.outliers import choose_content
    from map3d.site.files import update_files
    from map3d.site.steps import site_files

    with progress_bar(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()) as bar:
        task = bar.add_task("importing", total=None)

        def report(name: str, done: int, total: int, how_far: Message | None) -> None:
            bar.update(task, description=f"importing {name}: {how_far}" if how_far else f"importing {name}", completed=done, total=total)

        summary = update_files(workspace, catalogue, site_files(request), report)
    choose_content(catalogue, request.name, bool(request.keep_outliers), request.cluster or 0)
    _print_summary(summary)
    _print_problems(workspace, catalogue, request.name)
    return summary


def _print_summary(summary: "ImportSummary") -> None:
    from map3d.site.files import reasons

    counts = f"{len(summary.unchanged)} unchanged, {len(summary.failed)} failed, {len(summary.removed)} removed"
    click.echo(f"imported {plural(len(summary.imported), 'file')}, {counts}")
    for reason, names in reasons(summary.again).items():
        click.echo(f"imported again because {reason}: {names_text(names)}")
    if summary.removed:
        click.echo(f"removed, since no longer in the folder: {names_text(summary.removed)}")
    if summary.elsewhere:
        click.echo(f"kept, since not from this folder: {names_text(summary.elsewhere)}; map3d remove-files removes them")
    for note in note_lines(summary.ignored):
        click.echo(str(note))
    for _, error in summary.failed:
        click.echo(f"not imported: {error}", err=True)


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
    skipped, warnings = sum(map(skipped_count, reports)), sum(map(warning_count, reports))
    if skipped or warnings:
        click.echo(f"skipped {plural(skipped, 'element')}; {plural(warnings, 'warning')}; map3d show report {scene} lists them")
