"""Writes a building as OBJ (z up) in CRS coordinates; the materials of all buildings are in one MTL."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from map3d_town.atlas import Atlas
from map3d_town.ears import triangles_with_holes
from map3d_town.house import Built
from map3d_town.materials import DIFFUSE, WRAPS
from map3d_town.model import Face, Paint, Plain, Surface, Wrap

Points = NDArray[np.float64]


def obj_text(built: Built, name: str, atlas: Atlas | None, atlas_name: str, shift: Points) -> str:
    """One building: v, vt, faces by material. Polygons with holes are cut into triangles."""
    lines = ["mtllib town.mtl", f"o {name}"]
    by_material: dict[str, list[Face]] = {}
    for face in all_faces(built):
        by_material.setdefault(material_name(face, atlas_name), []).append(face)
    count = 0
    for material, faces in sorted(by_material.items()):
        lines.append(f"usemtl {material}")
        for face in faces:
            points, uvs, polygons = flat(face, atlas)
            lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in (points + shift).tolist()]
            lines += [f"vt {u:.6f} {v:.6f}" for u, v in uvs.tolist()]
            lines += ["f " + " ".join(f"{count + i + 1}/{count + i + 1}" for i in polygon) for polygon in polygons]
            count += len(points)
    return "\n".join(lines) + "\n"


def all_faces(built: Built) -> Iterable[Face]:
    """Every polygon of a building, openings included."""
    for body in built.bodies:
        groups: list[list[Surface]] = [body.shell, body.beyond, *(surfaces for _, surfaces in body.installations)]
        for surface in (s for group in groups for s in group):
            yield from surface.faces
            for opening in surface.openings:
                yield from opening.faces


def material_name(face: Face, atlas_name: str) -> str:
    """The atlas, the repeating texture or the plain material of a face."""
    if isinstance(face.paint, Paint):
        return atlas_name
    return face.paint.name


def flat(face: Face, atlas: Atlas | None) -> tuple[Points, Points, list[list[int]]]:
    """Points, texture coordinates and polygons of a face; one polygon unless it has holes."""
    if isinstance(face.paint, Paint):
        assert atlas is not None
        uvs = np.concatenate(atlas.uv(face))
    elif isinstance(face.paint, Wrap):
        uvs = np.concatenate(face.st) / face.paint.size_m
    else:
        uvs = np.zeros((sum(len(r) for r in face.rings), 2))
    points = np.concatenate(face.rings)
    if len(face.rings) == 1:
        return points, uvs, [list(range(len(points)))]
    return points, uvs, triangles_with_holes(face.st if not isinstance(face.paint, Plain) else [r[:, :2] for r in face.rings])


def mtl_text(atlases: Iterable[str]) -> str:
    """All materials: atlases, repeating textures, plain ones."""
    lines = []
    for name in atlases:
        lines += [f"newmtl {name}", "Kd 1 1 1", f"map_Kd textures/{name}.jpg", ""]
    for name in WRAPS:
        lines += [f"newmtl {name}", "Kd 1 1 1", f"map_Kd textures/{name}.jpg", ""]
    for name, color in sorted(DIFFUSE.items()):
        lines += [f"newmtl {name}", "Kd " + " ".join(f"{c:.3f}" for c in color), ""]
    return "\n".join(lines)
