"""An asset folder as it lies on disk (spec/scene.md): its objects with their boxes, its digest, and putting a new one in place of an old one."""

import ctypes
import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from map3d.errors import Corrupt, StoreError
from map3d.registry import NewObject
from map3d.registry.object_boxes import object_boxes, unite_boxes
from map3d.types import Box, Vec3

MAGIC: Final = b"M3DA"
VERSION: Final = 1
_HEADER_BYTES: Final = 64
_SLICE: Final = 1 << 20
_AT_FDCWD, _RENAME_EXCHANGE = -100, 2


class Mesh(NamedTuple):
    """Mapped sections: (nv, 3) positions, (nt, 3) triangles, (nt,) object and prototype numbers."""

    positions: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    objects: NDArray[np.uint32]
    prototypes: NDArray[np.uint32]


def open_mesh(folder: Path) -> Mesh:
    """Maps mesh.m3a; raises Corrupt when its head and its length do not fit."""
    path = folder / "mesh.m3a"
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    if len(header) < _HEADER_BYTES or header[:4] != MAGIC:
        raise Corrupt(f"{path}: not a mesh file")
    version = int.from_bytes(header[4:8], "little")
    if version != VERSION:
        raise Corrupt(f"{path}: version {version}; this map3d reads version {VERSION}")
    nv, nt, flags = int.from_bytes(header[16:24], "little"), int.from_bytes(header[24:32], "little"), int.from_bytes(header[32:36], "little")
    sizes = {
        "positions": nv * 24,
        "triangles": nt * 12,
        "uvs": nt * 24,
        "normals": nt * 36 * (flags & 1),
        "material": nt * 4,
        "object": nt * 4,
        "rank": nt,
    }
    offsets, at = {}, _HEADER_BYTES
    for name, size in {**sizes, "prototype": nt * 4}.items():
        offsets[name] = at
        at = -(-(at + size) // 64) * 64
    if path.stat().st_size < offsets["prototype"] + nt * 4:
        raise Corrupt(f"{path}: {path.stat().st_size} bytes, expected at least {offsets['prototype'] + nt * 4}")
    return Mesh(
        _mapped(path, offsets["positions"], np.dtype("<f8"), (nv, 3)),
        _mapped(path, offsets["triangles"], np.dtype("<u4"), (nt, 3)),
        _mapped(path, offsets["object"], np.dtype("<u4"), (nt,)),
        _mapped(path, offsets["prototype"], np.dtype("<u4"), (nt,)),
    )


def read_objects(folder: Path) -> list[dict[str, Any]]:
    """The lines of objects.jsonl."""
    with (folder / "objects.jsonl").open(encoding="utf-8") as lines:
        return [json.loads(line) for line in lines]


def world_boxes(folder: Path, count: int) -> list[Box | None]:
    """Of every object in world coordinates, placements of prototypes included; None without geometry."""
    mesh = open_mesh(folder)
    placed = _boxes(mesh, mesh.prototypes, 0, count)
    boxes: list[Box | None] = [_box(row) for row in placed]
    instances = json.loads((folder / "materials.json").read_text(encoding="utf-8")).get("instances", [])
    frames: dict[int, Box | None] = {}
    for instance in instances:
        number = instance["prototype"]
        if number not in frames:
            frames[number] = _whole(_boxes(mesh, mesh.prototypes, number, count))
        boxes[instance["object"]] = unite_boxes(boxes[instance["object"]], _moved(frames[number], instance["transform"]))
    return boxes


def new_objects(lines: list[dict[str, Any]], boxes: list[Box | None], origin: Vec3) -> list[NewObject]:
    """As the registry takes them; boxes become local."""
    return [
        NewObject(line["name"], line["class"], line["parent"], line["lod"], line["attributes"], _local(box, origin))
        for line, box in zip(lines, boxes, strict=True)
    ]


def write_ids(folder: Path, ids: NDArray[np.uint32]) -> None:
    (folder / "ids.u32").write_bytes(ids.astype("<u4").tobytes())


def asset_digest(folder: Path) -> str:
    """Over all that a build depends on: the mesh by the checksum in its head, images by their names, which are hashes of them."""
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
    """`draft` becomes `final` in one step, and durably; what was there before is removed. Raises StoreError."""
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
        raise StoreError(f"{final}: cannot be put in place: {error}") from error


def _exchange(a: Path, b: Path) -> None:
    """Swaps two folders atomically; where the system cannot, in two steps."""
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is not None and renameat2(_AT_FDCWD, os.fsencode(a), _AT_FDCWD, os.fsencode(b), _RENAME_EXCHANGE) == 0:
        return
    aside = a.with_name(a.name + ".old")
    b.rename(aside)
    a.rename(b)
    aside.rename(a)


def _mapped(path: Path, offset: int, dtype: "np.dtype[Any]", shape: tuple[int, ...]) -> Any:
    return np.memmap(path, dtype, "r", offset, shape) if shape[0] else np.zeros(shape, dtype)


def _boxes(mesh: Mesh, prototypes: NDArray[np.uint32], number: int, count: int) -> NDArray[np.float64]:
    """(count, 2, 3) of the triangles of one prototype, in slices, so that memory stays low."""
    total = object_boxes(np.zeros((0, 3)), np.zeros((0, 3), np.uint32), np.zeros(0, np.uint32), count)
    for start in range(0, len(prototypes), _SLICE):
        part = slice(start, start + _SLICE)
        mine = prototypes[part] == number
        if mine.any():
            boxes = object_boxes(mesh.positions, mesh.triangles[part][mine], mesh.objects[part][mine], count)
            np.minimum(total[:, 0], boxes[:, 0], out=total[:, 0])
            np.maximum(total[:, 1], boxes[:, 1], out=total[:, 1])
    return total


def _box(row: NDArray[np.float64]) -> Box | None:
    if row[0, 0] > row[1, 0]:
        return None
    low, high = row.tolist()
    return ((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def _whole(rows: NDArray[np.float64]) -> Box | None:
    return _box(np.stack([rows[:, 0].min(axis=0), rows[:, 1].max(axis=0)])) if len(rows) else None


def _moved(box: Box | None, transform: list[float]) -> Box | None:
    """The box of the eight moved corners: it holds the moved content, if not tightly."""
    if box is None:
        return None
    matrix = np.array(transform).reshape(3, 4)
    corners = np.array([(x, y, z) for x in (box[0][0], box[1][0]) for y in (box[0][1], box[1][1]) for z in (box[0][2], box[1][2])])
    moved = corners @ matrix[:, :3].T + matrix[:, 3]
    return _box(np.stack([moved.min(axis=0), moved.max(axis=0)]))


def _local(box: Box | None, origin: Vec3) -> Box | None:
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
