"""Reads asset folders (spec/scene.md) with NumPy alone, independently of the core."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

SECTIONS = (
    ("positions", "<f8", 3),
    ("triangles", "<u4", 3),
    ("uvs", "<f4", 6),
    ("normals", "<f4", 9),
    ("material", "<u4", 1),
    ("object", "<u4", 1),
    ("rank", "u1", 1),
    ("prototype", "<u4", 1),
)


@dataclass(frozen=True)
class Asset:
    """positions (nv, 3) float64 world; triangles (nt, 3); uvs (nt, 3, 2); material, object, prototype (nt,); ids (objects,) of the registry."""

    folder: Path
    positions: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    uvs: NDArray[np.float32]
    material: NDArray[np.uint32]
    object: NDArray[np.uint32]
    prototype: NDArray[np.uint32]
    ids: NDArray[np.uint32]
    materials: list[dict]

    @property
    def corners(self) -> NDArray[np.float64]:
        """(nt, 3, 3) world."""
        return self.positions[self.triangles]


def read_asset(folder: Path) -> Asset:
    data = np.fromfile(folder / "mesh.m3a", np.uint8)
    assert data[:4].tobytes() == b"M3DA"
    nv, nt = (int(v) for v in data[16:32].view("<u8"))
    has_normals = bool(data[32] & 1)
    at, parts = 64, {}
    for name, kind, width in SECTIONS:
        if name == "normals" and not has_normals:
            continue
        count = (nv if name == "positions" else nt) * width
        size = count * np.dtype(kind).itemsize
        parts[name] = data[at : at + size].view(kind).reshape(-1, width) if width > 1 else data[at : at + size].view(kind)
        at += -(-size // 64) * 64
    return Asset(
        folder,
        parts["positions"],
        parts["triangles"],
        parts["uvs"].reshape(-1, 3, 2),
        parts["material"],
        parts["object"],
        parts["prototype"],
        np.fromfile(folder / "ids.u32", "<u4"),
        json.loads((folder / "materials.json").read_text())["materials"],
    )
