"""map3d add-files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from map3d.catalogue import Workspace
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.cli.options import Bytes, json_option, workspace_option
from map3d.cli.output import print_json, print_table
from map3d.cli.progress import progress_bar
from map3d.errors import BadRequest, Map3dError, UnknownFormat


@click.command("add-files")
@click.argument("scene")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--crs", help="Coordinate system of the files, where they do not state it or state it wrongly; 'local' for local metres.")
@click.option("--name", help="Name of the asset.  [default: name of the file]")
@click.option("--up", type=click.Choice(["y", "z"]), default="z", show_default=True, help="OBJ: the axis that points up.")
@click.option("--split", type=click.Choice(["file", "group"]), default="file", show_default=True, help="OBJ: the part that becomes one object.")
@click.option("--theme", help="CityGML: the appearance theme to use.  [default: the first in the file]")
@click.option("--lod", help="CityGML: the level of detail to use.  [default: the best of each object]")
@click.option("--strict", is_flag=True, help="Stop at the first problem instead of skipping and counting it.")
@click.option(
    "--parse-memory", "parse_memory_bytes", type=Bytes(), help="Memory limit for reading a file.  [default: 1G; 2G for rasters and above 100 MB]"
)
@click.option(
    "--parse-cpu", "parse_cpu_s", type=click.IntRange(1), help="Limit in CPU seconds for reading a file.  [default: 60 per 100 MB; 600 for rasters]"
)
@json_option
@workspace_option
def command(workspace: Workspace, scene: str, files: Sequence[Path], as_json: bool, name: str | None, **options: Any) -> None:
    """Import FILES into SCENE: CityGML, OBJ, and GeoTIFF rasters of elevation and imagery. For a folder, import every file in a known format.

    A file with the name of an existing asset replaces that asset; its objects keep their ids.
    """
    from map3d.ingest.import_options import ImportOptions
    from map3d.ingest.importing import import_file
    from map3d.ingest.parser_process import ParserProcess
    from map3d.ingest.sources import find_sources

    done: list[Any] = []
    failed: list[tuple[str, str]] = []
    sources = find_sources(files, name, lambda path, reason: failed.append((str(path), reason)))
    if failed and options["strict"]:
        raise UnknownFormat(failed[0][1])
    if name is not None and len(sources) > 1:
        raise BadRequest(f"--name {name}: applies to a single file, got {len(sources)}")
    catalogue = workspace.open_catalogue()
    try:
        catalogue.scene(scene)
        columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
        with ParserProcess() as parser, progress_bar(*columns) as bar:
            for number, source in enumerate(sources, 1):
                task = bar.add_task(f"{number} of {len(sources)}: {source.paths[0].name}")
                try:
                    show = _show(bar, task, source.paths[0].name)
                    done.append(import_file(workspace, catalogue, scene, source, ImportOptions(**options), show, parser=parser))
                except Map3dError as error:
                    if options["strict"] or len(sources) + len(failed) == 1:
                        raise
                    failed.append((str(source.paths[0]), str(error)))
                bar.remove_task(task)
    finally:
        catalogue.close()
    if as_json:
        print_json({"imported": done, "failed": [{"source": path, "error": text} for path, text in failed]})
    else:
        _print(scene, done, failed)
    if failed:
        raise click.exceptions.Exit(1)


def _show(bar: Progress, task: Any, name: str) -> Any:
    return lambda how_far: bar.update(task, description=f"{name}: {how_far}")


def _print(scene: str, done: Sequence[Any], failed: Sequence[tuple[str, str]]) -> None:
    rows = [
        (item.asset, item.format, item.objects, item.triangles, sum(item.report.get("skipped", {}).values()), _placed(item.report)) for item in done
    ]
    if rows:
        print_table(("asset", "format", "objects", "triangles", "skipped", "coordinates"), rows)
    for item in done:
        for warning in item.report.get("warnings", [])[:8]:
            click.echo(f"{item.asset}: {warning['count']:,} × {warning['reason']}, e.g. {warning['example']}")
    for _, text in failed:
        click.echo(f"not imported: {text}", err=True)
    if done:
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
