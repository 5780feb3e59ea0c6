"""Scenes of boxes, built by the core alone."""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from map3d import _core

OBJECT = {"name": "house", "class": "building", "parent": None, "lod": None, "attributes": {}}
MATERIAL = {"name": "m", "diffuse": [0.8, 0.7, 0.6, 1.0], "texture": None, "alpha": None, "wrap": "none", "border": [0, 0, 0, 0], "cutout": False}
CORNERS = np.array([(x, y, z) for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
QUADS = [(4, 5, 7, 6), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
TRIANGLES = np.array([[(a, b, c), (a, c, d)] for a, b, c, d in QUADS], np.uint32).reshape(-1, 3)

House = tuple[float, float, float, float]
"""x, y of the south-west corner, side, height."""


def build_houses(folder: Path, houses: Iterable[House]) -> _core.Scene:
    """Builds a scene of houses with ids 1, 2, …, without a ground plane."""
    return _build(folder, [(CORNERS * (side, side, height) + (x, y, 0.0), TRIANGLES) for x, y, side, height in houses])


def build_soup(folder: Path, corners: NDArray[np.float64]) -> _core.Scene:
    """Builds a scene of triangles (n, 3, 3) with ids 1, 2, …"""
    one = np.array([[0, 1, 2]], np.uint32)
    return _build(folder, [(triangle, one) for triangle in corners])


def _build(folder: Path, meshes: list[tuple[NDArray[np.float64], NDArray[np.uint32]]]) -> _core.Scene:
    """Builds a scene with an object for each mesh."""
    asset = folder / "assets" / "houses"
    asset.mkdir(parents=True)
    writer = _core.AssetWriter(str(asset))
    for number, (positions, triangles) in enumerate(meshes):
        writer.append_mesh(positions, triangles, None, 0, number, 3)
    count = len(meshes)
    writer.set_tables(json.dumps({"materials": [MATERIAL], "instances": []}), json.dumps([OBJECT] * count))
    writer.finish()
    np.arange(1, count + 1, dtype="<u4").tofile(asset / "ids.u32")
    options = {"merge_vertices": True, "merge_faces": True, "drop_degenerate": True, "merge_materials": True, "drop_untextured": False}
    request = {"assets": ["houses"], "origin": [0, 0, 0], "options": {**options, "ground_plane": "off", "keep_outliers": True}}
    _core.build_scene(str(folder), json.dumps({**request, "ground_id": 0, "threads": 1, "max_memory_bytes": 1 << 30}))
    return _core.Scene(str(folder))
