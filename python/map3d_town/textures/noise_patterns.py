"""Noise and grey patterns, (height, width) uint8 around 128, and their colouring, (height, width) uint32 packed by `pack_color`."""

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
    """Packs a colour into one number, red in the lowest byte. This makes fills and look-ups several times faster than three channels."""
    r, g, b = color
    return np.uint32(r | g << 8 | b << 16)


def to_image(picture: PackedImage) -> Image.Image:
    """Converts a packed image to an RGB image."""
    height, width = picture.shape
    return Image.frombuffer("RGBX", (width, height), np.ascontiguousarray(picture, dtype=PACKED), "raw", "RGBX", 0, 1).convert("RGB")


def from_image(image: Image.Image) -> PackedImage:
    """Converts an RGB image to a packed image, (height, width)."""
    return np.frombuffer(image.tobytes("raw", "RGBX"), dtype=PACKED).reshape(image.height, image.width)


@lru_cache(maxsize=1)
def noise_image() -> GreyImage:
    """Returns (2048, 2048): 2 × 2 copies of a seamless noise of 1024² pixels with fine grain, blotches and large stains."""
    source = rng(1, "noise")
    total = np.zeros((NOISE_PX, NOISE_PX), dtype=np.float32)
    for cells, weight in ((1024, 9.0), (256, 7.0), (32, 8.0), (8, 8.0)):
        grid = source.normal(0, 1, (cells, cells)).astype(np.float32)
        total += weight * _enlarge_periodic(grid, NOISE_PX // cells)
    return np.tile(np.clip(128 + total, 0, 255).astype(np.uint8), (2, 2))


def _enlarge_periodic(grid: NDArray[np.float32], times: int) -> NDArray[np.float32]:
    """Enlarges a periodic grid with linear interpolation."""
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
    """Returns a piece of the noise at a position that depends on `key`; a view unless it exceeds 1024 pixels."""
    y, x = key * 613 % NOISE_PX, key * 277 % NOISE_PX
    if height_px <= NOISE_PX and width_px <= NOISE_PX:
        return noise_image()[y : y + height_px, x : x + width_px]
    wide = np.take(noise_image(), np.arange(x, x + width_px) % NOISE_PX, axis=1)
    return np.asarray(np.take(wide, np.arange(y, y + height_px) % NOISE_PX, axis=0))


@lru_cache(maxsize=4096)
def color_ramp(color: Color, contrast: float) -> PackedImage:
    """Returns (512,) packed: entry i is the colour shaded by grey i − 128, clipped to 0 … 255; entry 256 is the colour itself."""
    grey = np.clip(np.arange(512) - 128, 0, 255).astype(np.float32)[:, None]
    value = np.asarray(color, dtype=np.float32) * (1 + (grey - 128) / 128 * contrast)
    r, g, b = np.clip(value, 0, 255).astype(np.uint32).T
    return np.asarray(r | g << 8 | b << 16, dtype=PACKED)


def colorize(shade: GreyImage, color: Color, contrast: float = 0.55) -> PackedImage:
    """Colours a grey image with the shades of a colour."""
    return np.take(color_ramp(color, contrast)[128:384], shade, mode="clip")


def colorize_sum(total: NDArray[np.int16], color: Color, contrast: float) -> PackedImage:
    """Colours the sum of two grey images, with 256 as its mean."""
    return np.take(color_ramp(color, contrast), total, mode="clip")


def add_grey(a: GreyImage, b: GreyImage) -> NDArray[np.int16]:
    """Returns the sum of two grey images, for `colorize_sum`."""
    return np.add(a, b, dtype=np.int16)


def repeat_pattern(pattern: GreyImage, width_px: int, height_px: int, key: int = 0) -> GreyImage:
    """Repeats a pattern over an area; `key` shifts it."""
    h, w = pattern.shape[:2]
    wide = np.take(pattern, np.arange(key % w, key % w + width_px) % w, axis=1)
    return np.asarray(np.take(wide, np.arange(key % h, key % h + height_px) % h, axis=0))


def blend_grey(a: GreyImage, b: GreyImage) -> GreyImage:
    """Combines two grey images into one."""
    return np.asarray(np.clip(add_grey(a, b) - 128, 0, 255), dtype=np.uint8)


@lru_cache(maxsize=128)
def roof_tile_pattern(px_per_m: float, row_m: float, column_m: float, relief: float) -> GreyImage:
    """Returns a pattern of staggered tiles of varying tone, with a shadow below each row."""
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
    """Returns a masonry pattern: staggered blocks of varying tone with joints."""
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
