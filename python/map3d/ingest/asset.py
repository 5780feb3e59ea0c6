"""Asset folders (spec/scene.md): their objects with boxes, their digest, and replacing one folder by another."""

import ctypes
import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.errors import StoreError
from map3d.ingest.content import ContentExtent
from map3d.registry import NewObject
from map3d.registry.object_boxes import unite_boxes
from map3d.types import Box, Vec3

_HEADER_BYTES: Final = 64
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


def read_objects(folder: Path) -> list[dict[str, Any]]:
    """Returns the lines of objects.jsonl."""
    with (folder / "objects.jsonl").open(encoding="utf-8") as lines:
        return [json.loads(line) for line in lines]


def world_boxes(folder: Path, count: int, extent: ContentExtent | None = None) -> list[Box | None]:
    """Returns the box of each of `count` objects as drawn, in world coordinates, placed prototypes included, or None. With an extent, the boxes
    of what is in it."""
    return boxes_within(folder, count, extent)[0]


def boxes_within(folder: Path, count: int, extent: ContentExtent | None) -> tuple[list[Box | None], list[int]]:
    """Returns the box of each object, and the number of its triangles and placed prototypes outside the extent."""
    mesh = _core.AssetMesh(str(folder / "mesh.m3a"))
    boxes, prototypes, outside = mesh.boxes(count, None if extent is None else extent.text)
    instances = json.loads((folder / "materials.json").read_text(encoding="utf-8")).get("instances", [])
    for instance in instances:
        transform = mesh.placed(instance["object"], instance["transform"])
        if transform is None:
            continue
        place = (transform[3], transform[7], transform[11])
        if extent is not None and not extent.keeps_point(place):
            outside[instance["object"]] += 1
            continue
        placed = _moved(prototypes.get(instance["prototype"]), transform)
        boxes[instance["object"]] = unite_boxes(boxes[instance["object"]], placed)
    return boxes, outside


def left_out(folder: Path, count: int) -> NDArray[np.int64]:
    """Returns the numbers of the objects that adjustments leave out; draped ones are not among them."""
    adjustments = _core.read_adjustments(str(folder))
    if adjustments is None:
        return np.empty(0, dtype=np.int64)
    drawn = np.zeros(count, dtype=bool)
    if (folder / "draped.m3a").exists():
        drawn[_core.AssetMesh(str(folder / "draped.m3a")).objects] = True
    return np.flatnonzero(np.isnan(adjustments[1]) & ~drawn)


def new_objects(lines: list[dict[str, Any]], boxes: list[Box | None], origin: Vec3) -> list[NewObject]:
    """Returns the objects as the registry takes them, with local boxes."""
    return [
        NewObject(line["name"], line["class"], line["parent"], line["lod"], line["attributes"], local_box(box, origin))
        for line, box in zip(lines, boxes, strict=True)
    ]


def write_ids(folder: Path, ids: NDArray[np.uint32]) -> None:
    (folder / "ids.u32").write_bytes(ids.astype("<u4").tobytes())


def asset_digest(folder: Path) -> str:
    """Returns the hash of everything that a build depends on: the mesh by the checksum in its header, images by their names, which are hashes."""
    total = hashlib.sha256()
    with (folder / "mesh.m3a").open("rb") as file:
        total.update(file.read(_HEADER_BYTES))
    for name in ("materials.json", "objects.jsonl", "ids.u32"):
        total.update((folder / name).read_bytes())
    for path in sorted((folder / "textures").iterdir()):
        total.update(path.name.encode())
    return total.hexdigest()[:32]


def write_report(folder: Path, report: Mapping[str, Any]) -> None:
    (folder / "report.json").write_text(json.dumps(report, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")


def put_in_place(draft: Path, final: Path) -> None:
    """Renames `draft` to `final` in one step, durably, and removes an older `final`. Raises StoreError."""
    try:
        for path in _files(draft):
            _sync(path)
        if final.exists():
            _exchange(draft, final)
            shutil.rmtree(draft)
        else:
            draft.rename(final)
        _sync(final.parent)
    except OSError as error:
        raise StoreError(f"{final}: cannot replace the folder: {error}") from error


def _exchange(a: Path, b: Path) -> None:
    """Swaps two folders atomically; in several steps on systems without renameat2."""
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is not None and renameat2(_AT_FDCWD, os.fsencode(a), _AT_FDCWD, os.fsencode(b), _RENAME_EXCHANGE) == 0:
        return
    aside = a.with_name(a.name + ".old")
    b.rename(aside)
    a.rename(b)
    aside.rename(a)


def _box(row: NDArray[np.float64]) -> Box | None:
    if row[0, 0] > row[1, 0]:
        return None
    low, high = row.tolist()
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def _moved(box: Box | None, transform: list[float]) -> Box | None:
    """Returns the box of the eight moved corners: it holds the moved content, but not tightly."""
    if box is None:
        return None
    matrix = np.array(transform).reshape(3, 4)
    corners = np.array([(x, y, z) for x in (box[0][0], box[1][0]) for y in (box[0][1], box[1][1]) for z in (box[0][2], box[1][2])])
    moved = corners @ matrix[:, :3].T + matrix[:, 3]
    return _box(np.stack([moved.min(axis=0), moved.max(axis=0)]))


def local_box(box: Box | None, origin: Vec3) -> Box | None:
    """Converts a box from world to local coordinates of a scene, metres."""
    if box is None:
        return None
    low, high = ((corner[0] - origin[0], corner[1] - origin[1], corner[2] - origin[2]) for corner in box)
    return (low, high)


def _files(folder: Path) -> Iterator[Path]:
    for place, _, names in os.walk(folder):
        yield from (Path(place, name) for name in names)
        yield Path(place)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
