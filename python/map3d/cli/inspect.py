"""map3d inspect."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from map3d.cli.file_tables import MAX_ROWS, findings_lines, kinds_text, print_files, textures_text
from map3d.cli.from_request import request_options
from map3d.cli.import_reports import exit_for_files
from map3d.cli.options import json_option
from map3d.cli.output import plural, print_json, size_text
from map3d.cli.progress import progress_bar
from map3d.ingest.file_notes import note_lines
from map3d.messages import Message
from map3d.requests import Inspect

if TYPE_CHECKING:
    from map3d.catalogue import SceneCrs
    from map3d.coherence.import_files import OnFile
    from map3d.scenes.file_contents import FileContents
    from map3d.scenes.inspection import Inspection


@click.command("inspect")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@request_options(Inspect)
@json_option
def command(files: Sequence[Path], request: Inspect, as_json: bool) -> None:
    """Say what FILES hold before importing them: coordinate system, place, extent, objects, textures and defects.

    FILES are read as an import into one scene reads them; for a folder, every file in a known format. Nothing is imported.
    """
    from map3d.ingest.import_options import ImportOptions
    from map3d.scenes.inspection import inspect_files

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with progress_bar(*columns) as bar:
        found = inspect_files(files, ImportOptions.of(request, virtual_rasters=True), _show(bar, bar.add_task("reading")))
    if as_json:
        print_json(found)
    else:
        _print(found)
    exit_for_files(len(found.failed), (one for file in found.files for one in file.findings))


def _show(bar: Progress, task: Any) -> "OnFile":
    def show(name: str, number: int, total: int, how_far: Message | None) -> None:
        bar.update(task, description=f"reading {name} ({number + 1} of {total}{f', {how_far}' if how_far else ''})")

    return show


def _print(found: "Inspection") -> None:
    from map3d.scenes.outlier_lines import outlier_lines

    if len(found.files) == 1:
        _print_one(found.files[0], found.crs)
    elif found.files:
        print_files(found.files)
        _print_rows(_summary(found))
    for line in findings_lines(found.files):
        click.echo(line)
    for message in outlier_lines(found.left_out, found.crs):
        click.echo(message)
    for note in note_lines(found.ignored):
        click.echo(str(note))
    for _, reason in found.failed:
        click.echo(f"not readable: {reason}", err=True)


def _print_one(file: "FileContents", crs: "SceneCrs | None") -> None:
    from map3d.scenes.outlier_lines import box_text

    rows = [
        ("file", f"{file.source}, {file.format}, {size_text(file.bytes)}"),
        ("coordinates", file.crs),
        ("heights", None if crs is None else crs.heights_text),
        ("place", file.place),
        ("extent", file.box and box_text(file.box)),
        ("objects", kinds_text(file.kinds)),
        ("triangles", f"{file.triangles:,}"),
        ("textures", textures_text(file)),
    ]
    if file.rasters is not None:
        rows.insert(1, ("rasters", f"{file.rasters.elevation:,} of elevation, {file.rasters.imagery:,} of imagery"))
    _print_rows(rows)


def _summary(found: "Inspection") -> Iterator[tuple[str, str | None]]:
    """Yields what holds for all files together."""
    from map3d.scenes.file_contents import sum_kinds
    from map3d.scenes.outlier_lines import box_text, cluster_message, middle_of

    yield "all", f"{plural(len(found.files), 'file')}, {size_text(sum(file.bytes for file in found.files))}"
    yield "coordinates", None if found.crs is None else f"{found.crs.name}{'' if found.crs.epsg is None else f' (EPSG:{found.crs.epsg})'}"
    yield "heights", None if found.crs is None else found.crs.heights_text
    if found.box is not None:
        yield "extent", f"{box_text(found.box)}, around {middle_of(found.box, found.crs)}"
    yield "objects", kinds_text(sum_kinds(found.files))
    for cluster in found.clusters[:MAX_ROWS]:
        yield f"place {cluster.number}", str(cluster_message(cluster, found.crs))
    if found.clusters:
        yield "", "the files lie in places far from each other; a map shows the first of them unless --cluster or --keep-outliers is given"


def _print_rows(rows: "Sequence[tuple[str, str | None]] | Iterator[tuple[str, str | None]]") -> None:
    for name, value in rows:
        if value:
            click.echo(f"{name:<12} {value}")
