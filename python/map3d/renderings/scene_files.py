"""Checks a scene's files against the checksums that they carry (spec/scene.md)."""

import json
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np
import xxhash

from map3d.errors import Corrupt
from map3d.ingest.asset import read_objects
from map3d.registry import Registry
from map3d.registry.object_boxes import unite_boxes
from map3d.types import Box

HEADER_BYTES: Final = {b"M3DA": 64, b"M3DC": 64, b"M3DI": 64, b"M3DT": 64}
"""What the checksum at byte 8 leaves out: the first 64 bytes."""

VERSION: Final = 1
_PIECE: Final = 1 << 22
_CHUNK_HEAD: Final = struct.Struct("<4sIQ3d6f6I")
"""Magic, version, checksum, origin, box, counts of nodes, leaves, triangles, objects, materials, flags."""
_CHUNK_OBJECT: Final = np.dtype([("id", "<u4"), ("rank", "<u4"), ("box", "<f4", 6), ("hash", "<u8", 2), ("pad", "V16")])


def binary_files(folder: Path) -> Iterator[Path]:
    """Meshes of assets, chunks, instances, textures."""
    for pattern in ("assets/[!.]*/mesh.m3a", "chunks/*.m3c", "instances.m3i", "textures/*/*.m3t"):
        yield from sorted(folder.glob(pattern))


def check_file(path: Path) -> str | None:
    """What is wrong with a binary file, None when nothing is."""
    with path.open("rb") as file:
        head = file.read(64)
        if len(head) < 64 or head[:4] not in HEADER_BYTES:
            return f"{path}: not a file of map3d (begins with {head[:4]!r})"
        version, checksum = int.from_bytes(head[4:8], "little"), int.from_bytes(head[8:16], "little")
        if version != VERSION:
            return f"{path}: version {version}, expected {VERSION}"
        digest = xxhash.xxh3_64()
        while piece := file.read(_PIECE):
            digest.update(piece)
    return None if digest.intdigest() == checksum else f"{path}: checksum {digest.intdigest():016x}, its head says {checksum:016x}"


def object_box(folder: Path, number: int) -> Box | None:
    """The local box of an object, from the tables at the end of the scene's chunks; None when no chunk has it."""
    found: Box | None = None
    for path in sorted(folder.glob("chunks/[!p]*.m3c")):
        with path.open("rb") as file:
            head = file.read(_CHUNK_HEAD.size)
            if len(head) < _CHUNK_HEAD.size:
                raise Corrupt(f"{path}: ends after {len(head)} bytes")
            origin, count = _CHUNK_HEAD.unpack(head)[3:6], _CHUNK_HEAD.unpack(head)[15]
            file.seek(-count * _CHUNK_OBJECT.itemsize, os.SEEK_END)
            table = np.frombuffer(file.read(), _CHUNK_OBJECT)
        for row in table[table["id"] == number]:
            low, high = (row["box"].reshape(2, 3).astype(np.float64) + origin).tolist()
            found = unite_boxes(found, ((low[0], low[1], low[2]), (high[0], high[1], high[2])))
    return found


def check_index(folder: Path) -> Iterator[str]:
    """What scene.json names and what is there."""
    index: dict[str, Any] = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    for entry in [*index["chunks"], *index["prototypes"]]:
        path = folder / entry["file"]
        if not path.is_file():
            yield f"{path}: named by scene.json, not there"
        elif "bytes" in entry and path.stat().st_size != entry["bytes"]:
            yield f"{path}: {path.stat().st_size} bytes, scene.json says {entry['bytes']}"
    if index["instances"]["count"] and not (folder / index["instances"]["file"]).is_file():
        yield f"{folder / index['instances']['file']}: named by scene.json, not there"


def check_ids(folder: Path, asset: str, registry: Registry) -> Iterator[str]:
    """An asset's ids.u32 and the registry say the same."""
    place = folder / "assets" / asset
    lines = read_objects(place)
    ids = np.fromfile(place / "ids.u32", "<u4")
    if len(ids) != len(lines):
        yield f"{place / 'ids.u32'}: {len(ids)} ids for {len(lines)} objects"
        return
    if len(np.unique(ids)) != len(ids) or (len(ids) and int(ids.min()) == 0):
        yield f"{place / 'ids.u32'}: an id is 0 or there twice"
    for number, line in zip(ids.tolist(), lines, strict=True):
        known = registry.get(number)
        if known is None or (known.asset, known.name) != (asset, line["name"]):
            is_known = "nothing" if known is None else f"{known.asset} {known.name}"
            yield f"{place}: object {line['name']} has id {number}, in the registry that is {is_known}"
