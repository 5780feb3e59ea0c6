"""Turns records into the JSON values of the REST API (api_schemas.py)."""

from datetime import datetime
from pathlib import PurePath
from typing import Any

from map3d.catalogue import AssetRecord, Job, LogLine, OperationRecord, RenderingRecord, SceneRecord
from map3d.ingest.findings import report_document, skipped_count, warning_count
from map3d.messages import Message
from map3d.web.http.host_folders import values_without_host_folders, without_host_folders


def scene_value(scene: SceneRecord) -> dict[str, Any]:
    value: dict[str, Any] = {"name": scene.name, "title": scene.title, "attribution": scene.attribution, "built": scene.built is not None}
    crs = scene.stated_crs
    if crs is not None:
        parts = {"name": crs.name, "epsg": crs.epsg, "vertical": crs.vertical}
        value["crs"] = {name: part for name, part in parts.items() if part is not None}
    if scene.origin is not None:
        value["origin"] = list(scene.origin)
    return value


def asset_value(asset: AssetRecord) -> dict[str, Any]:
    """The file is named without its folder on the server."""
    report = asset.report
    return {
        **_asset_head(asset),
        "triangles": report.get("triangles", 0),
        "skipped": skipped_count(report),
        "warnings": warning_count(report),
    }


def asset_report_value(asset: AssetRecord) -> dict[str, Any]:
    return {**_asset_head(asset), "report": values_without_host_folders(report_document(asset.report))}


def _asset_head(asset: AssetRecord) -> dict[str, Any]:
    return {"name": asset.name, "file": PurePath(asset.source).name, "format": asset.format, "digest": asset.digest}


def rendering_value(rendering: RenderingRecord) -> dict[str, Any]:
    names = ("name", "scene", "title", "attribution", "description", "res_m", "tile_px", "content_version")
    return {
        **{name: getattr(rendering, name) for name in names},
        "start_view": rendering.start_view or rendering.frames[0].id,
        "levels": rendering.zmax + 1,
        "views": [frame.id for frame in rendering.frames],
        "layers": [{"name": layer.name, "kind": layer.kind, "format": layer.format} for layer in rendering.layers],
    }


def failure_value(job: Job) -> dict[str, Any]:
    return {"track": job.track, "block": str(job.block), "kind": job.kind, "attempts": job.attempts, **_named("reason", job.reason)}


def operation_value(operation: OperationRecord) -> dict[str, Any]:
    """The worker that does the operation is not named, nor the folders of the host's files."""
    names = ("id", "kind", "target", "scene", "state", "cancelling", "done", "total", "asked_by")
    times = {name: getattr(operation, name) for name in ("created", "started", "ended")}
    return {
        **{name: getattr(operation, name) for name in names},
        **_named("stage", operation.stage),
        **_named("message", operation.message),
        "arguments": values_without_host_folders(operation.arguments),
        **{name: time_text(time) for name, time in times.items() if time is not None},
    }


def line_value(line: LogLine) -> dict[str, Any]:
    return {"number": line.number, "time": time_text(line.time), **_named("text", line.text)}


def _named(name: str, message: Message | None) -> dict[str, Any]:
    return {name: ""} if message is None else message.map_texts(without_host_folders).named(name)


def time_text(time: datetime) -> str:
    return time.isoformat(timespec="milliseconds").replace("+00:00", "Z")
