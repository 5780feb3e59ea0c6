"""map3d add-files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from map3d.catalogue import Workspace
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.cli.from_request import request_options
from map3d.cli.import_reports import asset_warning_lines, exit_for_files, place_line
from map3d.cli.options import json_option, workspace_option
from map3d.cli.output import print_json, print_table
from map3d.cli.progress import progress_bar
from map3d.ingest.file_notes import FileNote, note_lines
from map3d.ingest.findings import findings, skipped_count
from map3d.messages import Message
from map3d.requests import AddFiles

if TYPE_CHECKING:
    from map3d.coherence.import_files import OnFile


@click.command("add-files")
@click.argument("scene")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@request_options(AddFiles)
@json_option
@workspace_option
def command(workspace: Workspace, scene: str, files: Sequence[Path], request: AddFiles, as_json: bool) -> None:
    """Import FILES into SCENE: CityGML, OBJ, and GeoTIFF rasters of elevation and imagery. For a folder or a ZIP
    archive, import every file in a known format.

    A file that is in the scene already replaces its asset; its objects keep their ids. A file with the same name
    from another folder is an asset of its own, unless the first one is gone. --name NAME replaces the asset NAME.
    """
    from map3d.coherence.import_files import import_files
    from map3d.ingest.import_options import ImportOptions

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with workspace.open_catalogue() as catalogue:
        with progress_bar(*columns) as bar:
            show = _show(bar, bar.add_task("importing", total=None))
            result = import_files(workspace, catalogue, scene, files, ImportOptions.of(request, virtual_rasters=True), progress=show)
        place = place_line(workspace, catalogue, scene)
    done, failed = result.imported, result.failed
    if as_json:
        failures = [{"source": path, **reason.named("error")} for path, reason in failed]
        others = [{"source": path, **note.named("reason")} for path, note in result.ignored]
        print_json({"imported": done, "failed": failures, "ignored": others})
    else:
        _print(place, scene, done, failed, result.ignored)
    exit_for_files(len(failed), (found for item in done for found in findings(item.report)))


def _show(bar: Progress, task: Any) -> "OnFile":
    def show(name: str, number: int, total: int, how_far: Message | None) -> None:
        bar.update(task, description=f"{name}: {how_far}" if how_far else f"{number + 1} of {total}: {name}")

    return show


def _print(place: str | None, scene: str, done: Sequence[Any], failed: Sequence[tuple[str, Message]], ignored: Sequence[FileNote]) -> None:
    rows = [(item.asset, item.format, item.objects, item.triangles, skipped_count(item.report), _placed(item.report)) for item in done]
    if rows:
        print_table(("asset", "format", "objects", "triangles", "skipped", "coordinates"), rows)
    for item in done:
        for line in asset_warning_lines(item.asset, item.report):
            click.echo(line)
    for note in note_lines(ignored):
        click.echo(str(note))
    for _, text in failed:
        click.echo(f"not imported: {text}", err=True)
    if done:
        click.echo(place or "place: unknown")
        click.echo(f"next: map3d create-rendering {scene} NAME --res METRES")


def _placed(report: Mapping[str, Any]) -> str:
    placing = report.get("placing", {})
    if placing.get("from") in (None, placing.get("to")) or "heights" not in placing:
        return str(placing.get("to", ""))
    if placing["to"] == LOCAL_CRS_NAME:
        return f"{LOCAL_CRS_NAME} (numbers of {placing['from']}, unchanged)"
    accuracy = placing.get("accuracy_m")
    exact = "ballpark" if placing.get("ballpark") else f"± {accuracy:g} m" if accuracy is not None else "accuracy unknown"
    return f"{placing['from']} → {placing['to']} ({exact}); heights {placing['heights']}"
