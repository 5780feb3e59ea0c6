"""A made-up format: a text with a box in each line. All that map3d needs to import it is in this file."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from map3d import _core
from map3d.formats.source_format import SourceFormat
from map3d.ingest.document_reprojector import DocumentReprojector
from map3d.subprocess import Handler, ReportProgress

BOXES = SourceFormat(
    name="boxes",
    title="Boxes",
    readable="boxes (.boxes)",
    uploads="Boxes",
    version=7,
    detect=lambda head, _path: head.startswith(b"boxes\n"),
    parser="box_format:open_box_parser",
    suffixes=(".boxes",),
    companions=(".colours",),
    options=("transparency",),
    has_crs=False,
)
MATERIAL = {"name": "box", "diffuse": [0.8, 0.6, 0.4, 1.0], "texture": None, "alpha": None, "wrap": "wrap", "border": [0.0] * 4, "cutout": False}
SIDES = ((0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4), (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5))


def open_box_parser(_setup: Mapping[str, Any]) -> Handler:
    def handle(request: dict[str, Any], _blobs: list[bytes], _report_progress: ReportProgress) -> tuple[dict[str, Any], list[bytes]]:
        return _parse(request), []

    return handle


def _parse(request: Mapping[str, Any]) -> dict[str, Any]:
    reprojector = DocumentReprojector(request["format"], None, request["scene_crs"], stated=request["crs"])
    writer, objects = _core.AssetWriter(request["folder"]), []
    for line in Path(request["path"]).read_text("utf-8").splitlines()[1:]:
        name, *numbers = line.split()
        low, size = np.array(numbers, dtype=np.float64).reshape(2, 3)
        corners = low + size * np.array([[k & 1, k >> 1 & 1, k >> 2] for k in range(8)])
        positions = reprojector.to_world(corners, None, len(SIDES))
        assert positions is not None, "the boxes have no coordinate system of their own"
        writer.append_mesh(positions, np.array(SIDES, dtype=np.uint32), None, 0, len(objects), 0)
        objects.append({"name": name, "class": "box", "parent": None, "lod": None, "attributes": {"options": request["reader"]["transparency"]}})
    writer.set_tables(json.dumps({"materials": [MATERIAL]}), json.dumps(objects))
    report = reprojector.report(json.loads(writer.finish(None)))
    proposed = reprojector.proposed_crs
    return {"report": report, "crs": None if proposed is None else asdict(proposed)}
