"""Entry point of the limited subprocess that parses one city model: reads it, transforms it to the scene's CRS, writes an asset folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any, Final

from map3d import _core
from map3d.formats import find_format
from map3d.ingest.document_reprojector import DocumentReprojector
from map3d.ingest.document_sample import DocumentSample, read_sample
from map3d.ingest.evidence import Evidence
from map3d.ingest.findings import finding
from map3d.ingest.model_placement import OPTIONS as PLACEMENT_OPTIONS
from map3d.ingest.model_placement import ModelPlacement
from map3d.ingest.texture_places import transform_positions
from map3d.ingest.upright_check import UprightCheck
from map3d.subprocess import Handler, ReportProgress

_REPORT_EVERY_TRIANGLES: Final = 50_000
_MAX_NAMES: Final = 5


def open_document_parser(_setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], _blobs: list[bytes], report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return _parse(request, report_progress), []

    return handle


def _parse(request: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """`request`: {"path", "format", "folder", "reader": options of the core's Reader, "crs": the user's choice or None, "placing": members of
    `Evidence`, "place": what files beside a model say of its place, or None, "scene_crs": WKT, "local", or None while the scene has no CRS}.

    Returns {"report", "crs": the CRS proposed for the scene, None if nothing determines it}."""
    # Where the user states the CRS of all parts, textures are in that one, too.
    transform = None if request["crs"] else transform_positions
    options = {name: value for name, value in request["reader"].items() if name not in PLACEMENT_OPTIONS}
    reader = _core.Reader(request["path"], request["format"], json.dumps(options), transform)
    strict = bool(options.get("strict"))
    placement, batches, srs_name = ModelPlacement(request), iter(reader), reader.srs_name
    first = next(batches, None)
    placed_crs = placement.crs(None if first is None else placement.move(first.positions))
    evidence = Evidence(
        **request["placing"], sample=read_sample(Path(request["path"])) if find_format(request["format"]).has_crs else DocumentSample()
    )
    reprojector = DocumentReprojector(
        request["format"], srs_name or placed_crs, request["scene_crs"], stated=request["crs"], strict=strict, evidence=evidence
    )
    writer = _core.AssetWriter(request["folder"])
    upright, triangles, reported = UprightCheck(), 0, 0
    for batch in chain([] if first is None else [first], batches):
        if not batch.prototype:
            name = reader.crs_names()[batch.crs] or placed_crs
            positions = reprojector.to_world(placement.move(batch.positions), name, batch.triangle_count)
            if positions is None:
                continue
            upright.add(positions)
            batch.set_positions(positions)
        writer.append(batch)
        triangles += batch.triangle_count
        if triangles - reported >= _REPORT_EVERY_TRIANGLES:
            reported = triangles
            report_progress({"triangles": triangles})
    transforms, unplaced = reader.instances(), 0
    if len(transforms):
        unplaced = reader.set_instances(reprojector.transforms_to_world(transforms, reader.crs_names(), reader.instance_crs()))
    counts = json.loads(writer.finish(reader))
    if unplaced:
        counts["findings"].append(finding("implicit-geometry-without-place", unplaced))
    hints = upright.hints(request["path"]) if request["reader"].get("up") == "z" else []
    report = reprojector.report(counts)
    report["findings"] += [*hints, *placement.findings]
    grids = json.loads(reader.grids())
    if grids:
        report["grids"] = [grid | ({} if (axes := reprojector.axes(grid["crs"])) == "auto" else {"axes": axes}) for grid in grids]
        names = ", ".join(sorted({Path(grid["file"]).name for grid in grids})[:_MAX_NAMES])
        report["findings"].append(finding("relief-raster-read-as-terrain", len(grids), names))
    proposed = reprojector.proposed_crs
    return {"report": report, "crs": None if proposed is None else asdict(proposed)}
