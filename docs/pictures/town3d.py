"""Writes the town of the documentation images as 3D Tiles 1.1 for CesiumJS: the same triangles, trees and textures.

Unused areas of the atlases are magenta, which mipmaps would mix into the facades. They are filled with neighbouring colours, as map3d does
(usage mask, spec/scene.md).
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench.tiles3d import Floats, TilePart, read_tile_parts, write_tileset
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from map3d.catalogue import Workspace


def town_tileset(workspace: Workspace, scene: str, folder: Path) -> None:
    """Writes `folder`/3dtiles/town.json with its files, unless it exists."""
    if (folder / "3dtiles" / "town.json").is_file():
        return
    catalogue = workspace.open_catalogue()
    assets = [workspace.asset_folder(scene, asset.name) for asset in catalogue.assets(scene)]
    origin = np.array(catalogue.scene(scene).origin)
    catalogue.close()
    write_tileset(_filled(read_tile_parts(assets, origin), folder / "textures"), folder, "town", mipmaps=True)


def _filled(tiles: list[TilePart], folder: Path) -> list[TilePart]:
    """Copies the textures of the tiles to `folder`, with filled atlases."""
    folder.mkdir(parents=True, exist_ok=True)
    uvs: dict[str, list[NDArray[np.float32]]] = {}
    sources: dict[str, tuple[Path, dict[str, Any]]] = {}
    for part in tiles:
        for index in np.unique(part.materials):
            key = part.table[index]["texture"]
            if key:
                uvs.setdefault(key, []).append(part.uvs[part.materials == index])
                sources[key] = next(part.textures.glob(f"{key}.*")), part.table[index]
    for key, (path, entry) in sources.items():
        with Image.open(path) as image:
            atlas = entry["wrap"] == "none" and not entry["cutout"]
            (fill(image, np.concatenate(uvs[key])) if atlas else image).save(folder / f"{key}.png")
    return [replace(part, textures=folder) for part in tiles]


def fill(image: Image.Image, uvs: NDArray[np.float32]) -> Image.Image:
    """Fills the pixels outside all triangles, (n, 3, 2) texture coordinates, with colours of near pixels. Sides must be powers of two."""
    mask = Image.new("1", image.size)
    draw = ImageDraw.Draw(mask)
    for corners in (uvs * [1, -1] + [0, 1]) * image.size:
        draw.polygon([(x - 0.5, y - 0.5) for x, y in corners.tolist()], fill=1, outline=1)
    colors = _fill_from_neighbours(np.asarray(image.convert("RGB"), dtype=float), np.asarray(mask, dtype=float)[..., None])
    return Image.fromarray(np.round(colors).astype(np.uint8))


def _fill_from_neighbours(colors: Floats, weights: Floats) -> Floats:
    """Replaces pixels of weight 0 by the mean of the smallest enclosing block of 2^k × 2^k with any weight."""
    if (weights > 0).all() or len(colors) == 1:
        return colors
    sums, counts = _sum_2x2(colors * weights), _sum_2x2(weights)
    coarse = _fill_from_neighbours(sums / np.maximum(counts, 1), np.minimum(counts, 1))
    return np.where(weights > 0, colors, coarse.repeat(2, axis=0).repeat(2, axis=1))


def _sum_2x2(values: Floats) -> Floats:
    """Returns the sums of 2 × 2 pixels."""
    return values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]
