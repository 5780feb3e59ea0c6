"""Writes asset folders by hand, after spec/scene.md."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import xxhash

OBJECT = {"name": "x", "class": "building", "parent": None, "lod": None, "attributes": {}}


def write_asset(
    folder: Path,
    positions: Any,
    triangles: Any,
    objects: Any,
    prototypes: Any = None,
    instances: list[dict[str, Any]] | None = None,
    names: list[str] | None = None,
) -> Path:
    (folder / "textures").mkdir(parents=True)
    nt = len(triangles)
    parts = [
        np.asarray(positions, "<f8"),
        np.asarray(triangles, "<u4"),
        np.zeros((nt, 3, 2), "<f4"),
        np.zeros(0),
        np.zeros(nt, "<u4"),
        np.asarray(objects, "<u4"),
        np.zeros(nt, "u1"),
        np.asarray([0] * nt if prototypes is None else prototypes, "<u4"),
    ]
    body = b""
    for part in parts:
        body += part.tobytes()
        body += b"\0" * (-len(body) % 64)
    head = b"M3DA" + (1).to_bytes(4, "little") + xxhash.xxh3_64_intdigest(body).to_bytes(8, "little")
    head += len(positions).to_bytes(8, "little") + nt.to_bytes(8, "little")
    (folder / "mesh.m3a").write_bytes(head.ljust(64, b"\0") + body)
    (folder / "materials.json").write_text(json.dumps({"materials": [], "instances": instances or []}))
    lines = [{**OBJECT, "name": name} for name in names or [f"n{k}" for k in range(int(max(objects, default=-1)) + 1)]]
    (folder / "objects.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    (folder / "report.json").write_text("{}")
    return folder
