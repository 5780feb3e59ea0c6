"""Writes orthophoto and elevation of a town as GeoTIFF, window by window."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import rasterio
from PIL import Image, ImageDraw
from rasterio.transform import Affine
from rasterio.windows import Window

from map3d_town.layout.ground_heights import Ground
from map3d_town.layout.town_plan import TownPlan
from map3d_town.textures.noise_patterns import (
    PACKED,
    GreyImage,
    PackedImage,
    blend_grey,
    colorize,
    crop_noise,
    masonry_pattern,
    repeat_pattern,
    roof_tile_pattern,
)
from map3d_town.writers.jpeg_geotiff import JpegTiff

PATTERN_PX = 512
WINDOW_PX = 2048
ROWS_PX = 64
COLORS = {
    "meadow": (128, 140, 90), "lawn": (106, 128, 76), "lawn_light": (122, 140, 86), "garden": (94, 114, 66), "forest": (58, 84, 48),
    "field_green": (114, 134, 74), "field_gold": (190, 172, 116), "field_brown": (142, 116, 86), "asphalt": (104, 104, 106),
    "cobble": (138, 130, 120), "sidewalk": (172, 168, 160), "plaza": (190, 178, 158), "yard": (158, 148, 132), "gravel": (188, 178, 156),
    "concrete": (164, 162, 156), "water": (74, 108, 116), "bank": (110, 132, 80), "mark": (236, 234, 226), "car_white": (214, 216, 218),
    "car_dark": (52, 58, 68), "car_red": (140, 44, 40), "roof_red": (148, 86, 68), "roof_dark": (92, 84, 82), "roof_flat": (146, 144, 138),
    "roof_metal": (160, 166, 170), "sand": (206, 190, 152),
}  # fmt: skip
MATERIALS = tuple(COLORS)
NUMBERS = {name: number for number, name in enumerate(MATERIALS)}
CONTRASTS = {"mark": 0.08, "car_white": 0.05, "car_dark": 0.05, "car_red": 0.05, "water": 0.25, "asphalt": 0.35, "forest": 0.7, "garden": 0.7}


@lru_cache(maxsize=2)
def patterns(px_per_m: float) -> PackedImage:
    """Returns (materials · 512 · 512,) packed: a repeating texture for each ground material."""
    return np.concatenate([_pattern(number, name, px_per_m).ravel() for number, name in enumerate(MATERIALS)])


def _pattern(number: int, name: str, px_per_m: float) -> PackedImage:
    shade = np.roll(crop_noise(1024, 1024, 0)[::2, ::2], number * 37, axis=(0, 1))
    if name in ("cobble", "plaza", "sidewalk", "concrete"):
        size = {"cobble": 0.45, "plaza": 0.8, "sidewalk": 0.6, "concrete": 3.0}[name]
        shade = blend_grey(repeat_pattern(masonry_pattern(px_per_m, size, size, -26, 9), PATTERN_PX, PATTERN_PX), shade)
    elif name in ("roof_red", "roof_dark"):
        shade = blend_grey(repeat_pattern(roof_tile_pattern(px_per_m, 0.5, 0.4, 0.6), PATTERN_PX, PATTERN_PX), shade)
    elif name.startswith("field"):
        rows = (128 + 16 * np.sin(np.arange(PATTERN_PX) * 2 * np.pi / 16)).astype(np.uint8)
        shade = blend_grey(np.broadcast_to(rows[:, None], (PATTERN_PX, PATTERN_PX)), shade)
    return colorize(shade, COLORS[name], CONTRASTS.get(name, 0.5))


class OrthophotoRenderer:
    """Renders windows of the orthophoto; pixel (0, 0) is at the north-western corner of the town's square."""

    def __init__(self, plan: TownPlan, px_m: float) -> None:
        self.px_m, self.radius_m = px_m, plan.radius_m
        order = sorted(range(len(plan.patches)), key=lambda i: plan.patches[i].order)
        self.patches = [plan.patches[i] for i in order]
        corners = [(p.polygon.min(axis=0), p.polygon.max(axis=0)) for p in self.patches]
        self.low = np.array([c[0] for c in corners]).reshape(-1, 2)
        self.high = np.array([c[1] for c in corners]).reshape(-1, 2)
        self.crowns = np.array([(t.x, t.y, t.height_m) for t in plan.trees]).reshape(-1, 3)

    def render(self, x: int, y: int, width: int, height: int) -> PackedImage:
        """Renders the window with upper left pixel (x, y), (height, width) packed."""
        west, north = -self.radius_m + x * self.px_m, self.radius_m - y * self.px_m
        picture = _look_up_texels(self._materials(west, north, width, height), x, y, patterns(1 / self.px_m))
        self._add_tree_shadows(picture, west, north)
        return picture

    def _materials(self, west: float, north: float, width: int, height: int) -> GreyImage:
        """Returns (height, width): the number of the topmost material."""
        east, south = west + width * self.px_m, north - height * self.px_m
        mask = Image.new("L", (width, height), 0)
        draw = ImageDraw.Draw(mask)
        hit = (self.low[:, 0] < east) & (self.high[:, 0] > west) & (self.low[:, 1] < north) & (self.high[:, 1] > south)
        for i in np.flatnonzero(hit):
            patch = self.patches[i]
            px = ((patch.polygon - [west, north]) * [1 / self.px_m, -1 / self.px_m]).ravel().tolist()
            draw.polygon(px, fill=NUMBERS[patch.material])
        return np.asarray(mask)

    def _add_tree_shadows(self, picture: PackedImage, west: float, north: float) -> None:
        """Adds soft shadows of trees."""
        height, width = picture.shape
        if not len(self.crowns):
            return
        parts = picture.view(np.uint8).reshape(height, width, 4)
        x, y = (self.crowns[:, 0] - west) / self.px_m, (north - self.crowns[:, 1]) / self.px_m
        r = self.crowns[:, 2] * 0.3 / self.px_m
        for cx, cy, cr in np.stack([x, y, r], axis=1)[(x > -r) & (x < width + r) & (y > -r) & (y < height + r)].tolist():
            x0, x1, y0, y1 = max(0, int(cx - cr)), min(width, int(cx + cr) + 1), max(0, int(cy - cr)), min(height, int(cy + cr) + 1)
            if x1 <= x0 or y1 <= y0:
                continue
            d2 = ((np.arange(y0, y1)[:, None] - cy) ** 2 + (np.arange(x0, x1)[None, :] - cx) ** 2) / (cr * cr)
            light = 256 - (90 * np.clip(1.15 - d2, 0, 1)).astype(np.uint16)
            piece = parts[y0:y1, x0:x1]
            piece[:] = (piece * light[:, :, None]) >> 8


def _look_up_texels(materials: GreyImage, x: int, y: int, colors: PackedImage) -> PackedImage:
    """Looks up the texel of each pixel's material; in strips of rows that fit the CPU cache."""
    height, width = materials.shape
    picture = np.empty((height, width), dtype=PACKED)
    columns = np.arange(x, x + width, dtype=np.intp) % PATTERN_PX
    for top in range(0, height, ROWS_PX):
        rows = (np.arange(y + top, y + min(top + ROWS_PX, height), dtype=np.intp) % PATTERN_PX) * PATTERN_PX
        index = materials[top : top + ROWS_PX].astype(np.intp)
        index *= PATTERN_PX * PATTERN_PX
        index += rows[:, None]
        index += columns
        np.take(colors, index, mode="clip", out=picture[top : top + ROWS_PX])
    return picture


def north_up(west: float, north: float, px_m: float) -> Affine:
    """Returns the transform from pixels to the CRS; (west, north) is the outer corner of the first pixel."""
    return Affine(px_m, 0.0, west, 0.0, -px_m, north)


def write_ortho(path: Path, plan: TownPlan, px_m: float, side_px: int, epsg: int, east: float, north: float, check: Callable[[], None]) -> None:
    """Writes the orthophoto as JPEG in a tiled GeoTIFF; memory does not grow with its size.

    Calls `check` before each window; it may raise to stop.
    """
    renderer = OrthophotoRenderer(plan, px_m)
    with JpegTiff(path, side_px, px_m, epsg, east - plan.radius_m, north + plan.radius_m) as out:
        for y in range(0, side_px, WINDOW_PX):
            for x in range(0, side_px, WINDOW_PX):
                check()
                out.write(x, y, renderer.render(x, y, min(WINDOW_PX, side_px - x), min(WINDOW_PX, side_px - y)))


def write_dem(path: Path, ground: Ground, radius_m: float, px_m: float, crs: str, east: float, north: float) -> None:
    """Writes heights at pixel centres, float32. Nodata is -9999, but no pixel has it."""
    side = round(2 * radius_m / px_m)
    profile = {
        "driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "float32", "crs": crs, "nodata": -9999.0,
        "compress": "DEFLATE", "predictor": 3, "tiled": True, "blockxsize": 256, "blockysize": 256, "bigtiff": "IF_SAFER",
        "transform": north_up(east - radius_m, north + radius_m, px_m),
    }  # fmt: skip
    with rasterio.open(path, "w", **profile) as out:
        for y in range(0, side, WINDOW_PX):
            for x in range(0, side, WINDOW_PX):
                width, height = min(WINDOW_PX, side - x), min(WINDOW_PX, side - y)
                east_m = -radius_m + (np.arange(x, x + width) + 0.5) * px_m
                north_m = radius_m - (np.arange(y, y + height) + 0.5) * px_m
                heights = ground.height(east_m[None, :], north_m[:, None])
                out.write(heights.astype(np.float32), 1, window=Window(x, y, width, height))
