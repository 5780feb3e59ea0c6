"""Writes the teatime scene as OBJ files of one object each, z up, without CRS."""

import os
from pathlib import Path

import numpy as np

from map3d_town.teatime.teapot import ClosedMesh, teapot

# The teapot is 25.2 high and 52 long from spout to handle; the cube has sides of 21.
TEAPOT_SCALE = 8.0
TEAPOT_STEPS = 16
CUBE_CENTRE = (80.5, 11.5, 10.5)
CUBE_SIDE = 21.0
MTL = "newmtl teapot_green\nKd 0.180 0.560 0.240\n\nnewmtl cube_green\nKd 0.380 0.680 0.200\n"


def write_teatime(out: Path) -> None:
    """Writes teapot.obj, cube.obj and teatime.mtl into `out`; each run writes the same bytes."""
    out.mkdir(parents=True, exist_ok=True)
    files = {
        "teatime.mtl": MTL,
        "teapot.obj": obj_text("teapot", "teapot_green", teapot(TEAPOT_SCALE, TEAPOT_STEPS)),
        "cube.obj": obj_text("cube", "cube_green", cube()),
    }
    for name, text in files.items():
        part = out / f".{name}.part"
        part.write_bytes(text.encode())
        os.replace(part, out / name)


def cube() -> ClosedMesh:
    """Returns the cube with flat normals."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (CUBE_SIDE / 2)
    quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    a, b, c = (corners[triangles[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    flat = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    return ClosedMesh(corners + np.array(CUBE_CENTRE), triangles, np.repeat(flat[:, None], 3, axis=1))


def obj_text(name: str, material: str, mesh: ClosedMesh) -> str:
    """Formats an OBJ with normals; equal normals are written once."""
    rounded = np.round(mesh.normals.reshape(-1, 3), 5) + 0.0
    normals, index = np.unique(rounded, axis=0, return_inverse=True)
    index = index.reshape(-1, 3)
    lines = ["mtllib teatime.mtl", f"o {name}", f"usemtl {material}"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in (np.round(mesh.points, 6) + 0.0).tolist()]
    lines += [f"vn {x:.5f} {y:.5f} {z:.5f}" for x, y, z in normals.tolist()]
    for face, corners in zip(mesh.triangles + 1, index + 1, strict=True):
        lines.append("f " + " ".join(f"{v}//{n}" for v, n in zip(face, corners, strict=True)))
    return "\n".join(lines) + "\n"
