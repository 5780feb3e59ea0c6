"""Does the operations import and build."""

from collections.abc import Iterator
from functools import partial
from typing import Final

from map3d.catalogue import Catalogue, OperationRecord, Workspace
from map3d.coherence.import_files import FilesImport, import_files
from map3d.errors import ImportFailed
from map3d.ingest.file_notes import is_used, note_lines
from map3d.ingest.findings import findings, skipped_count
from map3d.ingest.import_options import ImportOptions
from map3d.ingest.importing import Imported
from map3d.messages import Message, message
from map3d.operations.operation_report import OperationReport
from map3d.operations.uploaded_files import check_host_path, remove_staging, stage
from map3d.requests import AddFiles, Build
from map3d.requests.json_values import from_json
from map3d.requests.scenes import WorkLimits
from map3d.scenes import build
from map3d.scenes.outliers import choose_content
from map3d.scenes.style import choose_style

MAX_LINES: Final = 200


def do_import(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> Message:
    """Imports the files; assets that are up to date stay, so that a repeated operation resumes where the first one stopped. The worker removes the
    uploads once the operation is done. Raises ImportFailed when a file is broken, after importing the others."""
    arguments = operation.arguments
    uploads, request = list(arguments.get("files", ())), from_json(AddFiles, arguments.get("options", {}), skip_unchanged=True)
    paths = [check_host_path(path) for path in arguments.get("paths", ())]
    try:
        if uploads:
            report.progress(message("unpacking"))
            folder = stage(workspace, operation.id, uploads, operation.asked_by, partial(_show_unpacked, report))
            paths += [folder] if request.name is None else sorted(folder.iterdir())
        done = import_files(workspace, catalogue, operation.target, paths, ImportOptions.of(request), progress=partial(_show_imported, report))
    finally:
        remove_staging(workspace, operation.id)
    _log(report, done)
    counts = {"files": len(done.imported), "unchanged": len(done.unchanged)}
    if done.failed:
        raise ImportFailed(message("imported-in-part", **counts, failed=len(done.failed), reason=done.failed[0][1]))
    if not done.ignored:
        return message("imported", **counts)
    used = sum(is_used(note) for _, note in done.ignored)
    return message("imported-of-files", **counts, used=used, ignored=len(done.ignored) - used)


def _show_unpacked(report: OperationReport, file: str, done: int, total: int) -> None:
    report.progress(message("unpacking-file", file=file), done, total)


def _show_imported(report: OperationReport, file: str, number: int, total: int, how_far: Message | None) -> None:
    report.progress(message("importing-progress", file=file, progress=how_far) if how_far else message("importing", file=file), number, total)


def _log(report: OperationReport, done: FilesImport) -> None:
    report.log_counted((line for item in done.imported for line in _import_lines(item)), MAX_LINES, "more-lines")
    report.log_counted(note_lines(done.ignored), MAX_LINES, "more-lines")
    report.log_counted((message("not-imported", reason=reason) for _, reason in done.failed), MAX_LINES, "more-files-not-imported")


def _import_lines(item: Imported) -> Iterator[Message]:
    counts = {"asset": item.asset, "objects": item.objects, "triangles": item.triangles}
    skipped = skipped_count(item.report)
    yield message("imported-file-in-part", **counts, elements=skipped) if skipped else message("imported-file", **counts)
    for found in findings(item.report)[:20]:
        yield message("about", what=item.asset, message=found.line)


def do_build(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> Message:
    request = from_json(Build, operation.arguments)
    choose_content(catalogue, operation.target, request.keep_outliers, request.cluster)
    choose_style(catalogue, operation.target, request.style)
    is_built = build_if_stale(workspace, catalogue, operation.target, request, report)
    return message("built" if is_built else "scene-up-to-date", scene=operation.target)


def build_if_stale(workspace: Workspace, catalogue: Catalogue, scene: str, limits: WorkLimits, report: OperationReport) -> bool:
    """Builds the scene if its files have changed; returns whether it did."""

    def progress(stage: str, done: int, total: int) -> bool:
        report.progress(message(f"building-{stage}"), done, total)
        return True

    threads, memory = limits.workers, limits.max_memory_bytes
    counts = build.build_if_stale(workspace, catalogue, scene, threads=threads, max_memory_bytes=memory, progress=progress)
    if counts is None:
        return False
    numbers = [message(f"built-{name.replace('_', '-')}", count=count) for name, count in counts.items() if isinstance(count, int) and count]
    report.log(message("built-counts", scene=scene, counts=numbers))
    report.log_counted(counts.get("outlier_lines", ()), MAX_LINES, "more-lines")
    problems = counts.get("texture_warnings", {}).items()
    report.log_counted((message("texture-problem", reason=reason, example=example) for reason, example in problems), MAX_LINES, "more-warnings")
    return True
