"""Packs textures into atlases; unused area stays magenta."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d_town.models.building_model import AtlasTexture, TexturedFace
from map3d_town.textures.facade_textures import draw_texture
from map3d_town.textures.noise_patterns import PackedImage, pack_color
from map3d_town.town_errors import TownError

GUTTER_PX = 3
MAGENTA = (255, 0, 255)
QUALITY = 88
SHRINK = 0.955
MOST_PX_PER_M, LEAST_PX_PER_M = 40.0, 0.2


@dataclass(frozen=True)
class TextureAtlas:
    """A square atlas. `areas`: (x, y, width, height) in pixels from the upper left corner, gutters included, by id of the texture."""

    side_px: int
    px_per_m: float
    areas: dict[int, tuple[int, int, int, int]]
    textures: tuple[AtlasTexture, ...]

    def uv(self, face: TexturedFace) -> list[NDArray[np.float64]]:
        """Returns the texture coordinates of the face's rings; (0, 0) is the lower left corner of the atlas."""
        assert isinstance(face.material, AtlasTexture)
        x, y, _, _ = self.areas[id(face.material)]
        scale = self.px_per_m / self.side_px
        shift = np.array([(x + GUTTER_PX) / self.side_px, 1 - (y + GUTTER_PX) / self.side_px - face.material.height_m * scale])
        return [st * scale + shift for st in face.st]


def pack_atlas(textures: Sequence[AtlasTexture], side_px: int) -> TextureAtlas:
    """Packs the textures on shelves, tallest first, at the largest scale that fits.

    Raises TownError if they do not fit at any scale.
    """
    total = sum((p.width_m + 0.2) * (p.height_m + 0.2) for p in textures)
    longest = max(max(p.width_m, p.height_m) for p in textures)
    opening_fits = (side_px - 2 * GUTTER_PX - 2) / longest
    scale = min(MOST_PX_PER_M, opening_fits, side_px * 0.97 / np.sqrt(total))
    while scale > LEAST_PX_PER_M:
        scale = np.floor(scale * 4) / 4 if scale > 4 else scale
        areas = _pack_shelves(textures, side_px, float(scale))
        if areas is not None:
            return TextureAtlas(side_px, float(scale), areas, tuple(textures))
        scale = min(scale * SHRINK, scale - 0.25 if scale > 4 else scale)
    raise TownError(f"{len(textures)} textures do not fit into an atlas of {side_px} px; increase texture_px or reduce buildings_per_texture")


def _pack_shelves(textures: Sequence[AtlasTexture], side_px: int, scale: float) -> dict[int, tuple[int, int, int, int]] | None:
    """Returns the areas of all textures at this scale, or None if they do not fit."""
    sizes = [(_padded_px(p.height_m, scale), _padded_px(p.width_m, scale), i) for i, p in enumerate(textures)]
    areas = {}
    spaces: list[list[int]] = []  # free areas below the textures on the shelves: x, y, width, height
    x = y = shelf = 0
    for height, width, i in sorted(sizes, key=lambda s: (-s[0], -s[1], s[2])):
        space = next((s for s in spaces if s[2] >= width and s[3] >= height), None)
        if space is not None:
            areas[id(textures[i])] = (space[0], space[1], width, height)
            if space[2] - width > 8:
                spaces.append([space[0] + width, space[1], space[2] - width, height])
            space[1], space[3] = space[1] + height, space[3] - height
            continue
        if x + width > side_px:
            x, y, shelf = 0, y + shelf, 0
        if x + width > side_px or y + height > side_px:
            return None
        areas[id(textures[i])] = (x, y, width, height)
        shelf = max(shelf, height)
        if shelf - height > 8:
            spaces.append([x, y + height, width, shelf - height])
        x += width
    return areas


def _padded_px(length_m: float, scale: float) -> int:
    return int(np.ceil(length_m * scale)) + 2 * GUTTER_PX


@lru_cache(maxsize=2)
def blank_atlas(side_px: int) -> PackedImage:
    """Returns an empty atlas."""
    return np.full((side_px, side_px), pack_color(MAGENTA))


def draw_atlas(atlas: TextureAtlas, key: int) -> PackedImage:
    """Draws all textures on magenta, (side, side) packed; gutters repeat the edges of the textures."""
    picture = blank_atlas(atlas.side_px).copy()
    g = GUTTER_PX
    for number, texture in enumerate(atlas.textures):
        x, y, w, h = atlas.areas[id(texture)]
        inner = draw_texture(texture, w - 2 * g, h - 2 * g, atlas.px_per_m, key * 31 + number)
        area = picture[y : y + h, x : x + w]
        area[g : h - g, g : w - g] = inner
        area[:g, g : w - g], area[h - g :, g : w - g] = inner[:1], inner[-1:]
        area[:, :g], area[:, w - g :] = area[:, g : g + 1], area[:, w - g - 1 : w - g]
    return picture


def encode_jpeg(picture: PackedImage, quality: int = QUALITY) -> bytes:
    """Encodes a packed image as JPEG without chroma subsampling, so magenta does not bleed far."""
    height, width = picture.shape
    buffer = io.BytesIO()
    Image.frombuffer("RGBX", (width, height), picture, "raw", "RGBX", 0, 1).save(buffer, "JPEG", quality=quality, subsampling=0)
    return buffer.getvalue()


def encode_png(picture: NDArray[np.uint8]) -> bytes:
    """Encodes an RGB or RGBA image as PNG."""
    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, "PNG", compress_level=6)
    return buffer.getvalue()
