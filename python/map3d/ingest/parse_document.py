"""What the limited child of an import does: reads one source document, brings it into the scene's system, writes an asset folder."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Final

from map3d import _core
from map3d.ingest.asset_reprojector import Placing
from map3d.subprocess import Handler, ReportProgress

_TELL_EVERY: Final = 50_000


def open_import(_setup: Mapping[str, Any]) -> Handler:
    def work(question: dict[str, Any], _blobs: list[bytes], report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return _import(question, report_progress), []

    return work


def _import(question: Mapping[str, Any], report_progress: ReportProgress) -> dict[str, Any]:
    """`question`: {"path", "format", "folder", "reader": options of the core's Reader, "crs": as the user gave it or None, "scene_crs": as text,
    "local", or None while the scene has none}. Answers {"report", "crs": the scene's system as proposed, None if nothing could decide it}."""
    reader = _open(question)
    placing = Placing(question["format"], question["crs"] or _source_name(reader, question), question["scene_crs"])
    writer = _core.AssetWriter(question["folder"])
    triangles = told = 0
    for batch in reader:
        if not batch.prototype:
            batch.set_positions(placing.world(batch.positions))
        writer.append(batch)
        triangles += batch.triangle_count
        if triangles - told >= _TELL_EVERY:
            told = triangles
            report_progress({"triangles": triangles})
    transforms = reader.instances()
    if len(transforms):
        reader.set_instances(placing.world_transforms(transforms))
    report = json.loads(writer.finish(reader))
    proposed = placing.proposed
    return {"report": {**report, "placing": placing.report}, "crs": None if proposed is None else asdict(proposed)}


def _open(question: Mapping[str, Any]) -> _core.Reader:
    return _core.Reader(question["path"], question["format"], json.dumps(question["reader"]))


def _source_name(reader: _core.Reader, question: Mapping[str, Any]) -> str | None:
    """What the source calls its system. Where its head does not tell, the whole document is looked through."""
    if reader.srs_name is None and question["format"] == "citygml":
        other = _open(question)
        for _ in other:
            if other.srs_name is not None:
                break
        return other.srs_name
    return reader.srs_name
