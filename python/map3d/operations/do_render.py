"""Does the operations render and publish."""

from pathlib import Path

from map3d.catalogue import Catalogue, OperationRecord, Workspace
from map3d.errors import BadRequest
from map3d.jobs import events
from map3d.jobs.event_messages import problem_text
from map3d.jobs.events import RunEvent
from map3d.jobs.run import Run
from map3d.jobs.run_counter import RunCounter
from map3d.jobs.run_settings import RunSettings
from map3d.operations.do_import import build_if_stale
from map3d.operations.operation_report import OperationReport
from map3d.publish import publish
from map3d.publish.published_folders import FOLDER, published_path
from map3d.quantities import plural
from map3d.requests import Publish, Render
from map3d.requests.json_values import from_json


def do_render(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> str:
    """Builds, plans and renders like `map3d render`. Raises BadRequest when blocks are left in quarantine."""
    name, request = operation.target, from_json(Render, operation.arguments)
    build_if_stale(workspace, catalogue, catalogue.rendering(name).scene, request, report)
    if request.retry_quarantined:
        catalogue.retry(name)
    settings = RunSettings(request.processes, request.max_memory_bytes)
    run = Run(workspace, catalogue, name, settings)
    report.progress("planning")
    plan = run.plan(lambda done, total: report.progress("planning", done, total))
    counter = RunCounter()

    def on_event(event: RunEvent) -> None:
        counter(event)
        if line := event_line(event):
            report.log(line)
        report.progress("rendering", counter.done, counter.total)

    result = run.work(plan, on_event)
    done = result.statistics
    if not result.complete:
        raise BadRequest(
            f"rendering {name} is incomplete: {plural(result.quarantined_jobs, 'block')} in quarantine, {result.open_jobs:,} open; "
            "see the reasons, then render again with retry_quarantined"
        )
    blocks, images = plural(done.done, "block"), plural(done.tiles, "image")
    return f"rendered {blocks}, {images}, {done.bytes / 1e6:,.1f} MB; complete (content version {result.content_version})"


def event_line(event: RunEvent) -> str:
    """Returns the log line of an event, empty for events without one."""
    if isinstance(event, events.Planned):
        return f"{plural(event.open_jobs, 'block')} to render: {event.counts.added:,} new, {event.counts.changed:,} changed"
    if isinstance(event, events.Waiting):
        return f"waiting for {plural(event.jobs, 'block')} that other workers render"
    return problem_text(event)


def published_folder(workspace: Workspace, operation: OperationRecord) -> Path:
    """Returns the folder that a publication writes."""
    return published_path(workspace, str(operation.arguments.get("folder", operation.target)))


def do_publish(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> str:
    folder, request = published_folder(workspace, operation), from_json(Publish, operation.arguments, replace=True)
    folder.parent.mkdir(exist_ok=True)

    def progress(stage: str, done: int, total: int) -> bool:
        report.progress("publishing tiles" if stage == "publish" else f"publishing {stage}", done, total)
        return True

    done = publish(
        workspace,
        operation.target,
        folder,
        replace=request.replace,
        allow_incomplete=request.allow_incomplete,
        url=request.url,
        gis=request.gis,
        progress=progress,
    )
    files, size, shown = plural(done.files, "file"), done.bytes / 1e6, f"{FOLDER}/{folder.name}"
    return f"published to {shown}: {files}, {size:,.1f} MB; {done.written:,} written, {done.removed:,} removed"
