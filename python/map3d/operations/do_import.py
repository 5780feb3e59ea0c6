"""Does the operations import and build."""

from collections.abc import Iterator
from typing import Any, Final

from map3d.catalogue import Catalogue, OperationRecord, Workspace
from map3d.errors import ImportFailed
from map3d.ingest.findings import findings, skipped_count
from map3d.ingest.import_files import FilesImport, import_files
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported
from map3d.operations.operation_report import OperationReport
from map3d.operations.uploaded_files import check_host_path, remove_staging, stage
from map3d.quantities import plural
from map3d.requests import AddFiles, Build
from map3d.requests.json_values import from_json
from map3d.requests.scenes import WorkLimits
from map3d.scenes import build
from map3d.scenes.outliers import choose_content
from map3d.scenes.style import choose_style

MAX_LINES: Final = 200


def do_import(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> str:
    """Imports the files; assets that are up to date stay, so that a repeated operation resumes where the first one stopped. The worker removes the
    uploads once the operation is done. Raises ImportFailed when a file is broken, after importing the others."""
    arguments = operation.arguments
    uploads, request = list(arguments.get("files", ())), from_json(AddFiles, arguments.get("options", {}), skip_unchanged=True)
    paths = [check_host_path(path) for path in arguments.get("paths", ())]
    try:
        if uploads:
            report.progress("unpacking")
            folder = stage(
                workspace, operation.id, uploads, operation.asked_by, lambda file, done, total: report.progress(f"unpacking {file}", done, total)
            )
            paths += [folder] if request.name is None else sorted(folder.iterdir())
        show = _show(report)
        done = import_files(workspace, catalogue, operation.target, paths, ImportOptions.of(request), progress=show)
    finally:
        remove_staging(workspace, operation.id)
    _log(report, done)
    files, unchanged = plural(len(done.imported), "file"), len(done.unchanged)
    if done.failed:
        raise ImportFailed(f"imported {files}, {unchanged:,} unchanged, {len(done.failed):,} failed; the first: {done.failed[0][1]}")
    return f"imported {files}, {unchanged:,} unchanged"


def _show(report: OperationReport) -> Any:
    def show(name: str, number: int, total: int, how_far: str) -> None:
        report.progress(f"importing {name}: {how_far}" if how_far else f"importing {name}", number, total)

    return show


def _log(report: OperationReport, done: FilesImport) -> None:
    report.log_counted((line for item in done.imported for line in _import_lines(item)), MAX_LINES, "lines")
    report.log_counted((f"not imported: {reason}" for _, reason in done.failed), MAX_LINES, "files were not imported")


def _import_lines(item: Imported) -> Iterator[str]:
    skipped, objects, triangles = skipped_count(item.report), plural(item.objects, "object"), plural(item.triangles, "triangle")
    if skipped:
        yield f"{item.asset}: {objects}, {triangles}, skipped {plural(skipped, 'element')}"
    else:
        yield f"{item.asset}: {objects}, {triangles}"
    for found in findings(item.report)[:20]:
        yield f"{item.asset}: {found}"


def do_build(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> str:
    request = from_json(Build, operation.arguments)
    choose_content(catalogue, operation.target, request.keep_outliers, request.cluster)
    choose_style(catalogue, operation.target, request.style)
    is_built = build_if_stale(workspace, catalogue, operation.target, request, report)
    return f"built scene {operation.target}" if is_built else f"scene {operation.target} is up to date"


def build_if_stale(workspace: Workspace, catalogue: Catalogue, scene: str, limits: WorkLimits, report: OperationReport) -> bool:
    """Builds the scene if its files have changed; returns whether it did."""

    def progress(stage: str, done: int, total: int) -> bool:
        report.progress(f"building: {stage}", done, total)
        return True

    threads, memory = limits.workers, limits.max_memory_bytes
    counts = build.build_if_stale(workspace, catalogue, scene, threads=threads, max_memory_bytes=memory, progress=progress)
    if counts is None:
        return False
    numbers = ", ".join(f"{count:,} {name.replace('_', ' ')}" for name, count in counts.items() if isinstance(count, int) and count)
    report.log(f"built scene {scene}: {numbers}")
    report.log_counted(counts.get("outlier_lines", ()), MAX_LINES, "lines")
    report.log_counted((f"texture: {reason}: {example}" for reason, example in counts.get("texture_warnings", {}).items()), MAX_LINES, "warnings")
    return True
