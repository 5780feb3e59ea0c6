"""The town of the pictures as 3D Tiles 1.1 for CesiumJS, trees and all: the same triangles, the same textures.

Its atlases are magenta where no facade is. Smaller copies of a texture would mix that into what lies beside it, so it is filled with colours from
there, as whoever makes such tiles with care does, and as map3d does itself (usage mask, spec/scene.md).
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench.tiles3d import Floats, Part, parts_of, write_tileset
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from map3d.catalogue import Workspace


def town_tileset(workspace: Workspace, scene: str, folder: Path) -> None:
    """Writes what is missing of `folder`/3dtiles/town.json."""
    if (folder / "3dtiles" / "town.json").is_file():
        return
    catalogue = workspace.open_catalogue()
    assets = [workspace.asset_folder(scene, asset.name) for asset in catalogue.assets(scene)]
    origin = np.array(catalogue.scene(scene).origin)
    catalogue.close()
    write_tileset(_filled(parts_of(assets, origin), folder / "textures"), folder, "town", mipmaps=True)


def _filled(tiles: list[Part], folder: Path) -> list[Part]:
    """The tiles with copies of their textures in `folder`, atlases filled."""
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
    """The image, its sides powers of two, with what the triangles (n, 3, 2) of texture coordinates do not touch in colours of what is near."""
    mask = Image.new("1", image.size)
    draw = ImageDraw.Draw(mask)
    for corners in (uvs * [1, -1] + [0, 1]) * image.size:
        draw.polygon([(x - 0.5, y - 0.5) for x, y in corners.tolist()], fill=1, outline=1)
    colors = _spread(np.asarray(image.convert("RGB"), dtype=float), np.asarray(mask, dtype=float)[..., None])
    return Image.fromarray(np.round(colors).astype(np.uint8))


def _spread(colors: Floats, weights: Floats) -> Floats:
    """(h, w, 3) with the mean of the nearest block of 2^k × 2^k that has any weight where (h, w, 1) is 0."""
    if (weights > 0).all() or len(colors) == 1:
        return colors
    sums, counts = _halved(colors * weights), _halved(weights)
    coarse = _spread(sums / np.maximum(counts, 1), np.minimum(counts, 1))
    return np.where(weights > 0, colors, coarse.repeat(2, axis=0).repeat(2, axis=1))


def _halved(values: Floats) -> Floats:
    """Sums over 2 × 2."""
    return values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]
