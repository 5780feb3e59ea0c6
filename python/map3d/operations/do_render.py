"""Does the operations render and publish."""

from pathlib import Path

from map3d.catalogue import Catalogue, OperationRecord, Workspace
from map3d.errors import BadRequest
from map3d.jobs import events
from map3d.jobs.event_messages import problem_message
from map3d.jobs.events import RunEvent
from map3d.jobs.run import Run
from map3d.jobs.run_counter import RunCounter
from map3d.jobs.run_settings import RunSettings
from map3d.messages import Message, message
from map3d.operations.do_import import build_if_stale
from map3d.operations.operation_report import OperationReport
from map3d.publish import publish
from map3d.publish.published_folders import FOLDER, published_path
from map3d.requests import Publish, Render
from map3d.requests.json_values import from_json


def do_render(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> Message:
    """Builds, plans and renders like `map3d render`. Raises BadRequest when blocks are left in quarantine."""
    name, request = operation.target, from_json(Render, operation.arguments)
    build_if_stale(workspace, catalogue, catalogue.rendering(name).scene, request, report)
    if request.retry_quarantined:
        catalogue.retry(name)
    settings = RunSettings(request.processes, request.max_memory_bytes)
    run = Run(workspace, catalogue, name, settings)
    planning = message("planning")
    report.progress(planning)
    plan = run.plan(lambda done, total: report.progress(planning, done, total))
    counter = RunCounter()

    def on_event(event: RunEvent) -> None:
        counter(event)
        if line := event_line(event):
            report.log(line)
        report.progress(message("rendering-blocks"), counter.done, counter.total)

    result = run.work(plan, on_event)
    done = result.statistics
    if not result.complete:
        raise BadRequest(message("rendering-incomplete", rendering=name, blocks=result.quarantined_jobs, open=result.open_jobs))
    return message("rendered", blocks=done.done, images=done.tiles, bytes=done.bytes, version=result.content_version)


def event_line(event: RunEvent) -> Message | None:
    """Returns the log line of an event, None for events without one."""
    if isinstance(event, events.Planned):
        return message("planned", blocks=event.open_jobs, added=event.counts.added, changed=event.counts.changed)
    if isinstance(event, events.Waiting):
        return message("waiting-for-blocks", blocks=event.jobs)
    return problem_message(event)


def published_folder(workspace: Workspace, operation: OperationRecord) -> Path:
    """Returns the folder that a publication writes."""
    return published_path(workspace, str(operation.arguments.get("folder", operation.target)))


def do_publish(workspace: Workspace, catalogue: Catalogue, operation: OperationRecord, report: OperationReport) -> Message:
    folder, request = published_folder(workspace, operation), from_json(Publish, operation.arguments)
    folder.parent.mkdir(exist_ok=True)

    def progress(stage: str, done: int, total: int) -> bool:
        report.progress(message(f"publishing-{stage}"), done, total)
        return True

    done = publish(
        workspace,
        operation.target,
        folder,
        replace=request.replace,
        allow_incomplete=request.allow_incomplete,
        url=request.url,
        gis=request.gis,
        max_file_bytes=request.max_file_bytes,
        progress=progress,
    )
    counts = {name: getattr(done, name) for name in ("files", "bytes", "written", "removed")}
    return message("published", folder=f"{FOLDER}/{folder.name}", **counts)
