"""Checks a scene's files: checksums, the scene index, ids (spec/scene.md)."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from map3d import _core
from map3d.ingest.asset import read_objects
from map3d.registry import Registry


def binary_files(folder: Path) -> Iterator[Path]:
    """Yields meshes of assets, chunks, instances and textures."""
    for pattern in ("assets/[!.]*/mesh.m3a", "chunks/*.m3c", "instances.m3i", "textures/*/*.m3t"):
        yield from sorted(folder.glob(pattern))


def check_file(path: Path) -> str | None:
    """Returns the fault of a binary file, None for a sound one."""
    try:
        _core.check_file(str(path))
    except _core.CoreError as error:
        return str(error)
    return None


def check_index(folder: Path) -> Iterator[str]:
    """Yields the differences between scene.json and the files."""
    index: dict[str, Any] = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    for entry in [*index["chunks"], *index["prototypes"]]:
        path = folder / entry["file"]
        if not path.is_file():
            yield f"{path}: named in scene.json, missing"
        elif "bytes" in entry and path.stat().st_size != entry["bytes"]:
            yield f"{path}: {path.stat().st_size} bytes, scene.json says {entry['bytes']}"
    if index["instances"]["count"] and not (folder / index["instances"]["file"]).is_file():
        yield f"{folder / index['instances']['file']}: named in scene.json, missing"


def check_ids(folder: Path, asset: str, registry: Registry) -> Iterator[str]:
    """Yields the differences between an asset's ids.u32 and the registry."""
    place = folder / "assets" / asset
    lines = read_objects(place)
    ids = np.fromfile(place / "ids.u32", "<u4")
    if len(ids) != len(lines):
        yield f"{place / 'ids.u32'}: {len(ids)} ids for {len(lines)} objects"
        return
    if len(np.unique(ids)) != len(ids) or (len(ids) and int(ids.min()) == 0):
        yield f"{place / 'ids.u32'}: an id is 0 or occurs twice"
    for number, line in zip(ids.tolist(), lines, strict=True):
        known = registry.get(number)
        if known is None or (known.asset, known.name) != (asset, line["name"]):
            is_known = "nothing" if known is None else f"{known.asset} {known.name}"
            yield f"{place}: object {line['name']} has id {number}, in the registry that is {is_known}"
