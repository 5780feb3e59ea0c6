"""Grey patterns and noise, and their colouring. Grey: (height, width) uint8 around 128. Colours: (height, width) uint32, packed (`packed`)."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d_town.models.facade_design import Color
from map3d_town.seeds import rng

GreyImage = NDArray[np.uint8]
PackedImage = NDArray[np.uint32]
NOISE_PX = 1024
PACKED = np.dtype("<u4")


def pack_color(color: Color) -> np.uint32:
    """A colour in one number: red in the lowest byte, the highest one unused. Filling and looking up are several times as fast as with three."""
    r, g, b = color
    return np.uint32(r | g << 8 | b << 16)


def to_image(picture: PackedImage) -> Image.Image:
    """An RGB image with the picture's pixels."""
    height, width = picture.shape
    return Image.frombuffer("RGBX", (width, height), np.ascontiguousarray(picture, dtype=PACKED), "raw", "RGBX", 0, 1).convert("RGB")


def from_image(image: Image.Image) -> PackedImage:
    """(height, width) packed, of an RGB image."""
    return np.frombuffer(image.tobytes("raw", "RGBX"), dtype=PACKED).reshape(image.height, image.width)


@lru_cache(maxsize=1)
def noise_image() -> GreyImage:
    """(2048, 2048) around 128: grain, blotches and large stains, the same 1024 pixels twice each way; it repeats without a seam."""
    source = rng(1, "noise")
    total = np.zeros((NOISE_PX, NOISE_PX), dtype=np.float32)
    for cells, weight in ((1024, 9.0), (256, 7.0), (32, 8.0), (8, 8.0)):
        grid = source.normal(0, 1, (cells, cells)).astype(np.float32)
        total += weight * _enlarge_periodic(grid, NOISE_PX // cells)
    return np.tile(np.clip(128 + total, 0, 255).astype(np.uint8), (2, 2))


def _enlarge_periodic(grid: NDArray[np.float32], times: int) -> NDArray[np.float32]:
    """The grid enlarged, linear between its values, periodic."""
    for axis in (0, 1):
        if times > 1:
            n = grid.shape[axis]
            at = np.arange(n * times) / times
            low = at.astype(int)
            part = (at - low).astype(np.float32)
            part = part[:, None] if axis == 0 else part[None, :]
            grid = np.take(grid, low % n, axis) * (1 - part) + np.take(grid, (low + 1) % n, axis) * part
    return grid


def crop_noise(width_px: int, height_px: int, key: int) -> GreyImage:
    """A piece of the noise, chosen by the key; a view of it unless it is larger than the noise."""
    y, x = key * 613 % NOISE_PX, key * 277 % NOISE_PX
    if height_px <= NOISE_PX and width_px <= NOISE_PX:
        return noise_image()[y : y + height_px, x : x + width_px]
    wide = np.take(noise_image(), np.arange(x, x + width_px) % NOISE_PX, axis=1)
    return np.asarray(np.take(wide, np.arange(y, y + height_px) % NOISE_PX, axis=0))


@lru_cache(maxsize=4096)
def color_ramp(color: Color, contrast: float) -> PackedImage:
    """(512,) packed: entry i is the colour in the grey i − 128, clipped to 0 … 255: the colour itself at 256, darker below and brighter above."""
    grey = np.clip(np.arange(512) - 128, 0, 255).astype(np.float32)[:, None]
    value = np.asarray(color, dtype=np.float32) * (1 + (grey - 128) / 128 * contrast)
    r, g, b = np.clip(value, 0, 255).astype(np.uint32).T
    return np.asarray(r | g << 8 | b << 16, dtype=PACKED)


def colorize(shade: GreyImage, color: Color, contrast: float = 0.55) -> PackedImage:
    """A grey picture in the shades of a colour."""
    return np.take(color_ramp(color, contrast)[128:384], shade, mode="clip")


def colorize_sum(total: NDArray[np.int16], color: Color, contrast: float) -> PackedImage:
    """The sum of two greys (256 is the middle) in the shades of a colour."""
    return np.take(color_ramp(color, contrast), total, mode="clip")


def add_grey(a: GreyImage, b: GreyImage) -> NDArray[np.int16]:
    """The sum of two greys, for `colored_sum`."""
    return np.add(a, b, dtype=np.int16)


def repeat_pattern(pattern: GreyImage, width_px: int, height_px: int, key: int = 0) -> GreyImage:
    """A pattern laid over an area, beginning at a place chosen by the key."""
    h, w = pattern.shape[:2]
    wide = np.take(pattern, np.arange(key % w, key % w + width_px) % w, axis=1)
    return np.asarray(np.take(wide, np.arange(key % h, key % h + height_px) % h, axis=0))


def blend_grey(a: GreyImage, b: GreyImage) -> GreyImage:
    """Two greys as one."""
    return np.asarray(np.clip(add_grey(a, b) - 128, 0, 255), dtype=np.uint8)


@lru_cache(maxsize=128)
def roof_tile_pattern(px_per_m: float, row_m: float, column_m: float, relief: float) -> GreyImage:
    """A pattern of staggered tiles, brighter and darker ones, with a shadow below each row."""
    rows, columns = 16, 24
    h, w = max(rows, round(rows * row_m * px_per_m)), max(columns, round(columns * column_m * px_per_m))
    y, x = (np.arange(h) + 0.5) * rows / h, (np.arange(w) + 0.5) * columns / w
    row = y.astype(int)
    shifted = (x[None, :] + 0.5 * (row[:, None] % 2)) % columns
    tone = rng(2, "tiles").normal(0, 16, (rows, columns))[row[:, None], shifted.astype(int)]
    fall, wave = (y % 1)[:, None], np.cos((shifted % 1) * 2 * np.pi)
    shade = 128 + tone + relief * (18 * (fall < 0.75) - 46 * (fall > 0.82) - 10 * wave)
    return np.asarray(np.clip(shade, 0, 255), dtype=np.uint8)


@lru_cache(maxsize=128)
def masonry_pattern(px_per_m: float, row_m: float, column_m: float, joint: float, spread: float) -> GreyImage:
    """A pattern of masonry: staggered blocks of differing tone with joints."""
    rows, columns = 16, 12
    h, w = max(rows * 2, round(rows * row_m * px_per_m)), max(columns * 2, round(columns * column_m * px_per_m))
    y, x = (np.arange(h) + 0.5) * rows / h, (np.arange(w) + 0.5) * columns / w
    row = y.astype(int)
    shifted = (x[None, :] + 0.5 * (row[:, None] % 2)) % columns
    tone = rng(3, "courses").normal(0, spread, (rows, columns))[row[:, None], shifted.astype(int)]
    bed, head = 0.5 - np.abs((y % 1)[:, None] - 0.5), 0.5 - np.abs(shifted % 1 - 0.5)
    edge = np.minimum(bed * row_m, head * column_m) * px_per_m
    shade = 128 + tone + joint * np.clip(1.0 - edge, 0, 1) * min(1.0, row_m * px_per_m / 4)
    return np.asarray(np.clip(shade, 0, 255), dtype=np.uint8)
