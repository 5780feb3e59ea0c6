"""The cities of bench/city.py as 3D Tiles 1.1: a quadtree of GLB files, converted from OBJ by obj2gltf and glTF-Transform (bench/viewer/glb.mjs).

The buildings that share an atlas are a tile, and so is each piece of terrain. Each cell has its own URLs, which the server maps to the files of its
district, as each cell has its own texels in the renderings. Coordinates are metres east, north and up of the scene's origin.
"""

import json
import math
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d import _core

from .city import CELL_M, SPECS, City, GridCell, assets_of

GLB = Path(__file__).parent / "viewer" / "glb.mjs"
Floats = NDArray[np.float64]
Box = tuple[Floats, Floats]


@dataclass(frozen=True)
class TilePart:
    """The triangles of a tile, all of one asset. `corners`: (n, 3, 3) local; `uvs`: (n, 3, 2); `materials`: (n,) indices into `table`."""

    corners: Floats
    uvs: NDArray[np.float32]
    materials: NDArray[np.uint32]
    table: list[dict[str, Any]]
    textures: Path

    @property
    def box(self) -> Box:
        points = self.corners.reshape(-1, 3)
        return points.min(axis=0), points.max(axis=0)


def tileset(city: City, far: bool = False) -> Path:
    """Writes the missing files of a city's tileset; returns its root file. `far`: for views of the whole city, one plain mesh per district."""
    out = city.folder / "3dtiles"
    out.mkdir(parents=True, exist_ok=True)
    kinds = sorted(set(city.cells.values()))
    boxes = {
        kind: _far_district(city.folder, out, kind) if far else write_tileset(district_parts(city.folder, kind), city.folder, kind) for kind in kinds
    }
    path = out / f"{city.name}{'-far' * far}.json"
    root = _quadtree_node({at: kind + "-far" * far for at, kind in city.cells.items()}, {kind + "-far" * far: box for kind, box in boxes.items()})
    path.write_text(json.dumps({"asset": {"version": "1.1"}, "geometricError": 2 * root["geometricError"], "root": {**root, "refine": "ADD"}}))
    return path


def district_parts(folder: Path, kind: str) -> list[TilePart]:
    """Returns the tiles of a district."""
    spec = SPECS[kind]
    return read_tile_parts(assets_of(folder, kind), np.array([spec.east_m, spec.north_m, spec.height_m]))


def read_tile_parts(assets: list[Path], origin: Floats) -> list[TilePart]:
    """Returns the tiles of some asset folders, with corners relative to `origin`, (3,) in the scene's CRS."""
    found = []
    for asset in assets:
        mesh = Mesh.read(asset / "mesh.m3a")
        given = json.loads((asset / "materials.json").read_text())
        rows, corners = _world_corners(mesh, given["instances"], origin)
        group = _tile_groups(mesh.objects[rows], mesh.materials[rows], given["materials"])
        for number in np.unique(group):
            mine = group == number
            found.append(TilePart(corners[mine], mesh.uvs[rows[mine]], mesh.materials[rows[mine]], given["materials"], asset / "textures"))
    return found


@dataclass(frozen=True)
class Mesh:
    """The arrays of a `_core.AssetMesh`, each copied once."""

    positions: Floats
    triangles: NDArray[np.uint32]
    uvs: NDArray[np.float32]
    materials: NDArray[np.uint32]
    objects: NDArray[np.uint32]
    prototypes: NDArray[np.uint32]

    @classmethod
    def read(cls, path: Path) -> "Mesh":
        mesh = _core.AssetMesh(str(path))
        return cls(mesh.positions, mesh.triangles, mesh.uvs, mesh.materials, mesh.objects, mesh.prototypes)


def _world_corners(mesh: Mesh, instances: list[dict[str, Any]], origin: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Returns (n,) numbers and (n, 3, 3) local corners of the triangles, those of prototypes once per instance."""
    rows = [np.flatnonzero(mesh.prototypes == 0)]
    corners = [mesh.positions[mesh.triangles[rows[0]]] - origin]
    for instance in instances:
        own, move = np.flatnonzero(mesh.prototypes == instance["prototype"]), np.array(instance["transform"]).reshape(3, 4)
        rows.append(own)
        corners.append(mesh.positions[mesh.triangles[own]] @ move[:, :3].T + (move[:, 3] - origin))
    return np.concatenate(rows), np.concatenate(corners)


def _tile_groups(objects: NDArray[np.uint32], materials: NDArray[np.uint32], table: list[dict[str, Any]]) -> NDArray[np.int64]:
    """Returns the tile of each triangle: the atlas or terrain texture of most triangles of its object."""
    own = np.array([index if re.match(r"textures/a\d|terrain", entry["name"]) else -1 for index, entry in enumerate(table)])[materials]
    result = np.zeros(len(objects), np.int64)
    for number in np.unique(objects):
        mine = objects == number
        atlases = own[mine & (own >= 0)]
        result[mine] = np.bincount(atlases).argmax() if len(atlases) else -1
    return result


def write_obj(part: TilePart, folder: Path) -> Path:
    """Writes an OBJ with z up and face normals, its MTL and textures; returns the OBJ."""
    folder.mkdir(parents=True, exist_ok=True)
    normal = np.cross(part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    used = np.unique(part.materials)
    mtl = []
    for index in used:
        entry = part.table[index]
        mtl += [f"newmtl m{index}", "Kd {:.4f} {:.4f} {:.4f}".format(*entry["diffuse"][:3]), "Ks 0 0 0"]
        if entry["texture"]:
            file = next(part.textures.glob(f"{entry['texture']}.*"))
            shutil.copy(file, folder / file.name)
            mtl.append(f"map_Kd {file.name}")
    lines = ["mtllib part.mtl", *("v {:.4f} {:.4f} {:.4f}".format(*point) for point in part.corners.reshape(-1, 3))]
    lines += ["vt {:.6f} {:.6f}".format(*pair) for pair in part.uvs.reshape(-1, 2)]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*row) for row in normal]
    for index in used:
        lines.append(f"usemtl m{index}")
        for row in np.flatnonzero(part.materials == index):
            lines.append("f " + " ".join(f"{3 * row + k}/{3 * row + k}/{row + 1}" for k in (1, 2, 3)))
    (folder / "part.mtl").write_text("\n".join(mtl) + "\n")
    path = folder / "part.obj"
    path.write_text("\n".join(lines) + "\n")
    return path


def write_tileset(tiles: list[TilePart], folder: Path, name: str, mipmaps: bool = False) -> Box:
    """Writes the missing GLBs and the tileset NAME.json of some tiles in `folder`/3dtiles; returns the bounding box.

    `mipmaps`: enables mipmapping of textures, which obj2gltf does not.
    """
    out = folder / "3dtiles"
    out.mkdir(parents=True, exist_ok=True)
    jobs = []
    for number, part in enumerate(tiles):
        if not (out / f"{name}-{number}.glb").is_file():
            obj = write_obj(part, folder / "obj" / f"{name}-{number}")
            jobs.append({"obj": str(obj), "glb": str(out / f"{name}-{number}.glb"), "mipmaps": mipmaps})
    _make_glbs(jobs, name)
    boxes = [part.box for part in tiles]
    whole = _union_boxes(boxes)
    children = [{**_bounding_volume(box, 0.0), "content": {"uri": f"{name}-{number}.glb"}} for number, box in enumerate(boxes)]
    root = {**_bounding_volume(whole), "refine": "ADD", "children": children}
    (out / f"{name}.json").write_text(json.dumps({"asset": {"version": "1.1"}, "geometricError": 2 * root["geometricError"], "root": root}))
    return whole


def _far_district(folder: Path, out: Path, kind: str) -> Box:
    """Writes a district as one mesh, each triangle in its mean colour out of 256."""
    tiles, glb = district_parts(folder, kind), out / f"{kind}-far.glb"
    if not glb.is_file():
        part = with_mean_colors(tiles, folder / "obj" / f"{kind}-palette")
        _make_glbs([{"obj": str(write_obj(part, folder / "obj" / f"{kind}-far")), "glb": str(glb)}], glb.stem)
    box = _union_boxes([part.box for part in tiles])
    root = {**_bounding_volume(box, 0.0), "refine": "ADD", "content": {"uri": glb.name}}
    (out / f"{kind}-far.json").write_text(json.dumps({"asset": {"version": "1.1"}, "geometricError": CELL_M, "root": root}))
    return box


def with_mean_colors(tiles: list[TilePart], folder: Path) -> TilePart:
    """Joins the tiles; the texture, written into `folder`, is a palette of 16 × 16 squares, and each triangle uses the centre of one."""
    folder.mkdir(parents=True, exist_ok=True)
    colors = np.concatenate([_mean_colors(part) for part in tiles])
    picture = Image.fromarray(colors[None].astype(np.uint8)).quantize(256, dither=Image.Dither.NONE)
    index = np.asarray(picture)[0].astype(np.int64)
    palette = np.zeros((256, 3), np.uint8)
    known = np.array(picture.getpalette() or [], np.uint8).reshape(-1, 3)
    palette[: len(known)] = known
    Image.fromarray(palette.reshape(16, 16, 3)).resize((64, 64), Image.Resampling.NEAREST).save(folder / "palette.png")
    uv = np.stack([(index % 16 + 0.5) / 16, 1 - (index // 16 + 0.5) / 16], axis=1).astype(np.float32)
    table = [{"name": "palette", "diffuse": [1, 1, 1, 1], "texture": "palette"}]
    corners = np.concatenate([part.corners for part in tiles])
    return TilePart(corners, np.repeat(uv[:, None], 3, axis=1), np.zeros(len(index), np.uint32), table, folder)


def _mean_colors(part: TilePart) -> Floats:
    """Returns (n, 3), sRGB 0..255: the texture at the centre of each triangle, averaged to 64 × 64."""
    result = np.zeros((len(part.corners), 3))
    for index in np.unique(part.materials):
        mine, entry = part.materials == index, part.table[index]
        if not entry["texture"]:
            result[mine] = 255 * np.array(entry["diffuse"][:3])
            continue
        with Image.open(next(part.textures.glob(f"{entry['texture']}.*"))) as image:
            small = np.asarray(image.convert("RGB").resize((64, 64), Image.Resampling.BOX), dtype=float)
        at = np.floor(part.uvs[mine].mean(axis=1) % 1 * 64).astype(int)
        result[mine] = small[63 - at[:, 1], at[:, 0]]
    return result


def _make_glbs(jobs: list[dict[str, Any]], name: str) -> None:
    if jobs:
        print(f"bench: {len(jobs)} GLB files of {name}", file=sys.stderr, flush=True)
        subprocess.run(["node", str(GLB)], input=json.dumps(jobs), text=True, check=True)


def _quadtree_node(cells: Mapping[GridCell, str], boxes: Mapping[str, Box], number: list[int] | None = None) -> dict[str, Any]:
    """Returns a quadtree of cells; a leaf refers to a district's tileset. Inner nodes have no content."""
    counter = [0] if number is None else number
    placed = {at: _translate_box(boxes[kind], at) for at, kind in cells.items()}
    whole = _bounding_volume(_union_boxes(list(placed.values())))
    if len(cells) == 1:
        kind = next(iter(cells.values()))
        counter[0] += 1
        offset = [CELL_M * step for step in next(iter(cells))]
        move = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *offset, 0, 1]
        leaf = {**_bounding_volume(boxes[kind]), "transform": move, "content": {"uri": f"place-{counter[0]}/{kind}.json"}}
        return {**whole, "children": [leaf]}
    middle = [(min(at[axis] for at in cells) + max(at[axis] for at in cells)) / 2 for axis in (0, 1)]
    quarters: dict[tuple[bool, bool], dict[GridCell, str]] = {}
    for at, kind in cells.items():
        quarters.setdefault((at[0] > middle[0], at[1] > middle[1]), {})[at] = kind
    return {**whole, "children": [_quadtree_node(quarter, boxes, counter) for quarter in quarters.values()]}


def _bounding_volume(box: Box, error: float | None = None) -> dict[str, Any]:
    """Returns bounding volume and geometric error of a tile; the default error is its diameter."""
    middle, half = (box[0] + box[1]) / 2, (box[1] - box[0]) / 2
    volume = [*middle, half[0], 0, 0, 0, half[1], 0, 0, 0, half[2]]
    return {
        "boundingVolume": {"box": [round(float(value), 3) for value in volume]},
        "geometricError": 2 * math.dist(half, (0, 0, 0)) if error is None else error,
    }


def _translate_box(box: Box, at: GridCell) -> Box:
    offset = np.array([at[0] * CELL_M, at[1] * CELL_M, 0.0])
    return box[0] + offset, box[1] + offset


def _union_boxes(boxes: list[Box]) -> Box:
    return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
