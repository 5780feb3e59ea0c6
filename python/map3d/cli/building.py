"""Builds a scene with a progress bar and prints the build report; on standard error, since the build is only one step of a command."""

from collections.abc import Mapping
from typing import Any

from rich.progress import BarColumn, MofNCompleteColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from map3d.catalogue import Catalogue, Workspace
from map3d.cli.output import console
from map3d.cli.progress import progress_bar, show_stage


def build_with_progress(
    workspace: Workspace, catalogue: Catalogue, scene: str, *, threads: int, max_memory_bytes: int | None = None
) -> dict[str, Any] | None:
    """Builds the scene if its files have changed, prints the report and returns it; returns None if the scene is up to date."""
    from map3d.scenes.build import BUILD_BYTES, build, is_stale

    if not is_stale(workspace, catalogue, scene):
        return None
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with progress_bar(*columns) as bar:
        task = bar.add_task("building", total=None)

        def progress(stage: str, done: int, total: int) -> bool:
            show_stage(bar, task, f"building: {stage}", done, total or None)
            return True

        report = build(workspace, catalogue, scene, threads=threads, max_memory_bytes=max_memory_bytes or BUILD_BYTES, progress=progress)
    show_report(scene, report)
    return report


def show_report(scene: str, report: Mapping[str, Any]) -> None:
    """Prints the counts of the build and the problems with images."""
    log = console()
    for line in report.get("outlier_lines", ()):
        log.print(str(line), style="yellow", markup=False)
    table = Table("count", "", title=f"built {scene}", title_justify="left", box=None, pad_edge=False, show_header=False)
    table.columns[0].justify = "right"
    for name, count in report.items():
        if isinstance(count, int) and count:
            table.add_row(f"{count:,}", name.replace("_", " "))
    log.print(table)
    for reason, example in report.get("texture_warnings", {}).items():
        log.print(f"{reason}: {example}")
