"""Formats buildings as OBJ with z up, in CRS coordinates, and one MTL for all of them."""

from collections.abc import Iterable

import numpy as np

from map3d_town.models.building_model import AtlasTexture, BuildingModel, PlainMaterial, RepeatingTexture, TexturedFace
from map3d_town.polygons_2d import Points
from map3d_town.textures.shared_materials import DIFFUSE_COLORS, REPEATING_TEXTURES
from map3d_town.textures.texture_atlas import TextureAtlas
from map3d_town.writers.ear_clipping import triangulate_with_holes


def obj_text(model: BuildingModel, name: str, atlas: TextureAtlas | None, atlas_name: str, crs_offset: Points) -> str:
    """Formats a building: v, vt, faces by material. Polygons with holes are triangulated."""
    lines = ["mtllib town.mtl", f"o {name}"]
    by_material: dict[str, list[TexturedFace]] = {}
    for face in model.faces():
        by_material.setdefault(_material_name(face, atlas_name), []).append(face)
    count = 0
    for material, faces in sorted(by_material.items()):
        lines.append(f"usemtl {material}")
        for face in faces:
            points, uvs, polygons = _face_arrays(face, atlas)
            lines += [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in (points + crs_offset).tolist()]
            lines += [f"vt {u:.6f} {v:.6f}" for u, v in uvs.tolist()]
            lines += ["f " + " ".join(f"{count + i + 1}/{count + i + 1}" for i in polygon) for polygon in polygons]
            count += len(points)
    return "\n".join(lines) + "\n"


def _material_name(face: TexturedFace, atlas_name: str) -> str:
    """Returns the name of the face's atlas, repeating texture or plain material."""
    if isinstance(face.material, AtlasTexture):
        return atlas_name
    return face.material.name


def _face_arrays(face: TexturedFace, atlas: TextureAtlas | None) -> tuple[Points, Points, list[list[int]]]:
    """Returns points, texture coordinates and polygons of a face; one polygon unless it has holes."""
    if isinstance(face.material, AtlasTexture):
        assert atlas is not None
        uvs = np.concatenate(atlas.uv(face))
    elif isinstance(face.material, RepeatingTexture):
        uvs = np.concatenate(face.st) / face.material.size_m
    else:
        uvs = np.zeros((sum(len(r) for r in face.rings), 2))
    points = np.concatenate(face.rings)
    if len(face.rings) == 1:
        return points, uvs, [list(range(len(points)))]
    return points, uvs, triangulate_with_holes(face.st if not isinstance(face.material, PlainMaterial) else [r[:, :2] for r in face.rings])


def mtl_text(atlases: Iterable[str]) -> str:
    """Formats all materials: atlases, repeating textures, plain materials."""
    lines = []
    for name in atlases:
        lines += [f"newmtl {name}", "Kd 1 1 1", f"map_Kd textures/{name}.jpg", ""]
    for name in REPEATING_TEXTURES:
        lines += [f"newmtl {name}", "Kd 1 1 1", f"map_Kd textures/{name}.jpg", ""]
    for name, color in sorted(DIFFUSE_COLORS.items()):
        lines += [f"newmtl {name}", "Kd " + " ".join(f"{c:.3f}" for c in color), ""]
    return "\n".join(lines)
