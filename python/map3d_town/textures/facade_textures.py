"""Draws textures of facades and roofs: (height, width) packed, row 0 at the top."""

import itertools

import numpy as np
from numpy.typing import NDArray
from PIL import ImageDraw

from map3d_town.models.building_model import AtlasTexture, Opening
from map3d_town.models.facade_design import TIMBER, Color
from map3d_town.textures.noise_patterns import (
    GreyImage,
    PackedImage,
    add_grey,
    colorize,
    colorize_sum,
    crop_noise,
    from_image,
    masonry_pattern,
    pack_color,
    repeat_pattern,
    roof_tile_pattern,
    to_image,
)
from map3d_town.textures.opening_textures import draw_opening_texture, scale_color

TILE_ROW_M, TILE_COLUMN_M = 0.34, 0.26


def draw_texture(texture: AtlasTexture, width_px: int, height_px: int, px_per_m: float, key: int) -> PackedImage:
    """Draws a texture; `key` varies the noise, so equal facades differ."""
    if texture.kind == "roof":
        return draw_roof(texture, width_px, height_px, px_per_m, key)
    return draw_facade(texture, width_px, height_px, px_per_m, key)


def draw_roof(texture: AtlasTexture, width_px: int, height_px: int, px_per_m: float, key: int) -> PackedImage:
    """Draws tiles, slates, metal sheets with seams, gravel or paving."""
    cover = next(iter(texture.traits))
    shade, color = crop_noise(width_px, height_px, key), texture.colors[0]
    pattern = roof_pattern(cover, px_per_m)
    contrast = 0.8 if cover in ("tiles", "dark", "roman") else 0.5
    if pattern is not None:
        return colorize_sum(add_grey(repeat_pattern(pattern, width_px, height_px, key), shade), color, contrast)
    picture = colorize(shade, color, contrast)
    if cover in ("metal", "copper"):
        seam = seams_px(width_px, max(3.0, 0.6 * px_per_m))
        picture[:, seam] = (picture[:, seam] >> 2 & 0x3F3F3F) * 3
    return picture


def seams_px(width_px: int, step_px: float) -> NDArray[np.intp]:
    """Returns the columns of equally spaced seams, all less than `width_px`."""
    seam = np.arange(0, width_px, step_px).astype(np.intp)
    return seam[seam < width_px]


def roof_pattern(cover: str, px_per_m: float) -> GreyImage | None:
    """Returns the repeating pattern of a roof cover, or None."""
    if cover in ("tiles", "dark", "roman"):
        relief = 1.3 if cover == "roman" else 0.9
        return roof_tile_pattern(px_per_m, TILE_ROW_M, TILE_COLUMN_M * (1.6 if cover == "roman" else 1), relief)
    if cover == "slate":
        return roof_tile_pattern(px_per_m, 0.25, 0.22, 0.5)
    return masonry_pattern(px_per_m, 0.5, 1.1, -30, 8) if cover == "paving" else None


def draw_facade(texture: AtlasTexture, width_px: int, height_px: int, px_per_m: float, key: int) -> PackedImage:
    """Draws a wall with plinth, cornices, timber frame, windows, doors and shops."""
    picture = draw_bare_wall(texture, width_px, height_px, px_per_m, key)
    facade = FacadeImage(picture, texture, px_per_m)
    plinth_m = (texture.floors_m[0] if texture.floors_m else 0.0) + 0.45
    if "panel" not in texture.traits and "plain" not in texture.traits:
        facade.draw_strip(0, plinth_m, scale_color(texture.colors[0], 0.72), contrast=0.5)
    if "dado" in texture.traits and "plain" not in texture.traits:
        facade.draw_strip(plinth_m, plinth_m + 1.1, (150, 52, 40), contrast=0.5)
    if "shop" in texture.traits and len(texture.floors_m) > 1:
        facade.draw_strip(plinth_m, texture.floors_m[1] - 0.2, texture.colors[4], contrast=0.35)
        facade.draw_strip(texture.floors_m[1] - 0.75, texture.floors_m[1] - 0.3, scale_color(texture.colors[4], 0.75), contrast=0.2)
    if texture.traits & {"cornice", "panel"}:
        facade.draw_cornices()
    if "timber" in texture.traits and "plain" not in texture.traits:
        facade.draw_timber_frame(key)
    if "quoins" in texture.traits:
        facade.draw_quoins()
    for number, opening in enumerate(texture.openings):
        facade.draw_opening(opening, (key * 7 + number * 5) % 4)
    return picture


def draw_bare_wall(texture: AtlasTexture, width_px: int, height_px: int, px_per_m: float, key: int) -> PackedImage:
    """Draws the bare wall: plaster, brick, ashlar, ribs or panels, darker near its foot and under the eaves."""
    height = (np.arange(height_px, 0, -1) - 0.5) / px_per_m
    dirt = 22 * np.exp(-height / 1.2) + 14 * np.exp(-(texture.height_m - height) / 0.5)
    pattern = wall_pattern(texture.traits, width_px, height_px, px_per_m)
    total = add_grey(crop_noise(width_px, height_px, key), pattern) if pattern is not None else crop_noise(width_px, height_px, key) + np.int16(128)
    total -= dirt.astype(np.int16)[:, None]
    return colorize_sum(total, texture.colors[0], 0.32 if not texture.traits & {"brick", "ashlar"} else 0.6)


def wall_pattern(traits: frozenset[str], width_px: int, height_px: int, px_per_m: float) -> GreyImage | None:
    """Returns the pattern of a wall, as large as the wall; None for plaster."""
    if "ribs" in traits:
        wave = (128 + 26 * np.sin(np.arange(width_px) * (2 * np.pi / max(2.5, 0.35 * px_per_m)))).astype(np.uint8)
        return np.broadcast_to(wave, (height_px, width_px))
    sizes = {"brick": (0.11, 0.32, 40, 18), "ashlar": (0.45, 0.9, -40, 10), "panel": (2.8, 3.0, -50, 3)}
    for trait, (row_m, column_m, joint, sample_evenly) in sizes.items():
        if trait in traits:
            return repeat_pattern(masonry_pattern(px_per_m, row_m, column_m, joint, sample_evenly), width_px, height_px)
    return None


class FacadeImage:
    """The image of a facade; its methods take metres from the lower left corner."""

    def __init__(self, picture: PackedImage, texture: AtlasTexture, px_per_m: float) -> None:
        self.picture, self.texture, self.px_per_m = picture, texture, px_per_m
        self.height_px, self.width_px = int(picture.shape[0]), int(picture.shape[1])

    def y(self, z_m: float) -> int:
        return min(max(round(self.height_px - z_m * self.px_per_m), 0), self.height_px)

    def x(self, s_m: float) -> int:
        return min(max(round(s_m * self.px_per_m), 0), self.width_px)

    def draw_strip(self, low_m: float, high_m: float, color: Color, contrast: float = 0.3) -> None:
        """Draws a horizontal strip over the whole width."""
        top, bottom = self.y(high_m), self.y(low_m)
        if bottom > top:
            self.picture[top:bottom] = colorize(crop_noise(self.width_px, bottom - top, top), color, contrast)

    def draw_cornices(self) -> None:
        """Draws a cornice with its shadow at each floor, and a thicker one under the eaves."""
        for z in self.texture.floors_m[1:]:
            self.draw_strip(z - 0.1, z + 0.1, self.texture.colors[1])
            self.draw_strip(z - 0.2, z - 0.1, scale_color(self.texture.colors[0], 0.7))
        if "cornice" in self.texture.traits:
            self.draw_strip(self.texture.height_m - 0.35, self.texture.height_m, self.texture.colors[1])

    def draw_quoins(self) -> None:
        """Draws corner stones, long and short alternately."""
        color = pack_color(self.texture.colors[1])
        step = 0.5
        for number, z in enumerate(np.arange(0, self.texture.height_m, step)):
            width = self.x(0.7 if number % 2 else 0.45)
            top, bottom = self.y(z + step * 0.92), self.y(z)
            self.picture[top:bottom, :width] = color
            self.picture[top:bottom, self.width_px - width :] = color

    def draw_timber_frame(self, key: int) -> None:
        """Draws half-timbering from the first floor up: posts, rails, and some braces."""
        image = to_image(self.picture)
        draw = ImageDraw.Draw(image)
        thick = max(1, round(0.2 * self.px_per_m))
        floors = [*self.texture.floors_m[1:], self.texture.height_m]
        count = max(2, round(self.texture.width_m / 1.25))
        posts = [self.x(i * self.texture.width_m / count) for i in range(count + 1)]
        for low, high in itertools.pairwise(floors):
            top, bottom, middle = self.y(high), self.y(low), self.y(low * 0.62 + high * 0.38)
            for y in (bottom, middle, top):
                draw.line([(0, y), (self.width_px, y)], fill=TIMBER, width=thick)
            for i, x in enumerate(posts):
                draw.line([(x, bottom), (x, top)], fill=TIMBER, width=thick)
                if i < count and (key + i + bottom) % 3 == 0:
                    ends = [(x, bottom), (posts[i + 1], top)] if (key + i) % 2 else [(x, top), (posts[i + 1], bottom)]
                    draw.line(ends, fill=TIMBER, width=thick)
        self.picture[:] = from_image(image)

    def draw_opening(self, opening: Opening, variant: int) -> None:
        """Draws a window, arch, door, gate or shop with its surround, and shutters if they fit."""
        x0, x1 = self.x(opening.left_m), self.x(opening.left_m + opening.width_m)
        y0, y1 = self.y(opening.low_m + opening.height_m), self.y(opening.low_m)
        if x1 - x0 < 2 or y1 - y0 < 2:
            return
        trim = max(1, round(0.13 * self.px_per_m))
        self.draw_surround(opening, x0, x1, y0, y1, trim)
        stamp = draw_opening_texture(opening.kind, x1 - x0, y1 - y0, self.px_per_m, self.texture.colors, variant)
        self.picture[y0:y1, x0:x1] = stamp
        if "shutters" in self.texture.traits and opening.kind == "window":
            self.draw_shutters(x0, x1, y0, y1)

    def draw_surround(self, opening: Opening, x0: int, x1: int, y0: int, y1: int, trim: int) -> None:
        """Draws the stone or wooden frame of an opening, with a sill below a window."""
        if "timber" in self.texture.traits or "panel" in self.texture.traits:
            trim = max(1, trim // 2)
        color = TIMBER if "timber" in self.texture.traits else self.texture.colors[1]
        self.picture[max(0, y0 - trim) : y1, max(0, x0 - trim) : x1 + trim] = pack_color(color)
        if opening.kind == "window":
            sill = min(self.height_px, y1 + trim)
            self.picture[y1:sill, max(0, x0 - trim) : x1 + trim] = pack_color(scale_color(color, 0.85))

    def draw_shutters(self, x0: int, x1: int, y0: int, y1: int) -> None:
        """Draws two open shutters with slats."""
        width = max(2, (x1 - x0) // 2 - 1)
        slats = 118 + 22 * (np.arange(y1 - y0) % max(2, round(0.09 * self.px_per_m)) == 0)
        leaf_px = colorize(np.broadcast_to(slats[:, None].astype(np.uint8), (y1 - y0, width)), self.texture.colors[3])
        for start in (x0 - width - 1, x1 + 1):
            if start >= 0 and start + width <= self.width_px:
                self.picture[y0:y1, start : start + width] = leaf_px
