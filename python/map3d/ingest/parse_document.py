"""Entry point of the limited subprocess that parses one city model: reads it, transforms it to the scene's CRS, writes an asset folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from map3d import _core
from map3d.errors import CrsError
from map3d.ingest.asset_reprojector import AssetReprojector
from map3d.ingest.upright_check import Extent
from map3d.subprocess import Handler, ReportProgress

_REPORT_EVERY_TRIANGLES: Final = 50_000


def open_document_parser(_setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], _blobs: list[bytes], report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return _parse(request, report_progress), []

    return handle


def _parse(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """`request`: {"path", "format", "folder", "reader": options of the core's Reader, "crs": the user's choice or None, "scene_crs": WKT, "local",
    or None while the scene has no CRS}. Returns {"report", "crs": the CRS proposed for the scene, None if nothing determines it}."""
    reader = _core.Reader(request["path"], request["format"], json.dumps(request["reader"]))
    reprojector = AssetReprojector(request["format"], request["crs"] or reader.srs_name, request["scene_crs"], stated=bool(request["crs"]))
    writer = _core.AssetWriter(request["folder"])
    extent, triangles, reported = Extent(), 0, 0
    for batch in reader:
        if not batch.prototype:
            positions = reprojector.to_world(batch.positions)
            extent.add(positions)
            batch.set_positions(positions)
        writer.append(batch)
        triangles += batch.triangle_count
        if triangles - reported >= _REPORT_EVERY_TRIANGLES:
            reported = triangles
            report_progress({"triangles": triangles})
    transforms = reader.instances()
    if len(transforms):
        reader.set_instances(reprojector.transforms_to_world(transforms))
    counts = json.loads(writer.finish(reader))
    hints = extent.hints(request["path"]) if request["format"] == "obj" and request["reader"].get("up") == "z" else []
    counts["warnings"] = [*counts.get("warnings", []), *reprojector.warnings, *hints]
    if reprojector.warnings and request["reader"].get("strict"):
        raise CrsError("{reason}: {example}".format_map(reprojector.warnings[0]))
    proposed = reprojector.proposed_crs
    return {"report": {**counts, "placing": reprojector.report}, "crs": None if proposed is None else asdict(proposed)}
