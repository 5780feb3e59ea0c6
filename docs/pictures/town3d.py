"""Converts the town of the pictures to 3D Tiles 1.1 for CesiumJS, including trees: the same triangles and textures.

Unused parts of its atlases are magenta. Mipmaps would mix that into the facades, so unused parts are filled with neighbouring colours, as map3d
does itself (usage mask, spec/scene.md).
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
    """Writes `folder`/3dtiles/town.json unless it exists."""
    if (folder / "3dtiles" / "town.json").is_file():
        return
    catalogue = workspace.open_catalogue()
    assets = [workspace.asset_folder(scene, asset.name) for asset in catalogue.assets(scene)]
    origin = np.array(catalogue.scene(scene).origin)
    catalogue.close()
    write_tileset(_filled(parts_of(assets, origin), folder / "textures"), folder, "town", mipmaps=True)


def _filled(tiles: list[Part], folder: Path) -> list[Part]:
    """Copies the textures to `folder` with filled atlases; returns the tiles with these copies."""
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
    """Fills the texels that no triangle (n, 3, 2 texture coordinates) touches with nearby colours. The image's sides must be powers of two."""
    mask = Image.new("1", image.size)
    draw = ImageDraw.Draw(mask)
    for corners in (uvs * [1, -1] + [0, 1]) * image.size:
        draw.polygon([(x - 0.5, y - 0.5) for x, y in corners.tolist()], fill=1, outline=1)
    colors = _spread(np.asarray(image.convert("RGB"), dtype=float), np.asarray(mask, dtype=float)[..., None])
    return Image.fromarray(np.round(colors).astype(np.uint8))


def _spread(colors: Floats, weights: Floats) -> Floats:
    """Replaces (h, w, 3) colours whose (h, w, 1) weight is 0 with the mean of the smallest enclosing block of 2^k × 2^k that has any weight."""
    if (weights > 0).all() or len(colors) == 1:
        return colors
    sums, counts = _halved(colors * weights), _halved(weights)
    coarse = _spread(sums / np.maximum(counts, 1), np.minimum(counts, 1))
    return np.where(weights > 0, colors, coarse.repeat(2, axis=0).repeat(2, axis=1))


def _halved(values: Floats) -> Floats:
    """Returns sums over squares of 2 × 2."""
    return values[::2, ::2] + values[1::2, ::2] + values[::2, 1::2] + values[1::2, 1::2]
