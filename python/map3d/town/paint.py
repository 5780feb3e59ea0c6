"""Paints facades and roofs into arrays of (height, width, 3) uint8, sRGB; row 0 is the upper edge."""

import itertools
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from map3d.town.facade import TIMBER, Color
from map3d.town.model import Opening, Paint
from map3d.town.seeds import rng

Pixels = NDArray[np.uint8]
NOISE_PX = 1024
TILE_ROW_M, TILE_COLUMN_M = 0.34, 0.26


def painted(paint: Paint, width_px: int, height_px: int, px_per_m: float, key: int) -> Pixels:
    """The picture of a paint; `key` chooses its stains, so that equal facades differ."""
    if paint.kind == "roof":
        return paint_roof(paint, width_px, height_px, px_per_m, key)
    return paint_facade(paint, width_px, height_px, px_per_m, key)


@lru_cache(maxsize=1)
def noise() -> Pixels:
    """(1024, 1024) uint8 around 128: grain, blotches and large stains; it repeats without a seam."""
    source = rng(1, "noise")
    total = np.zeros((NOISE_PX, NOISE_PX), dtype=np.float32)
    for cells, weight in ((1024, 9.0), (256, 7.0), (32, 8.0), (8, 8.0)):
        grid = source.normal(0, 1, (cells, cells)).astype(np.float32)
        total += weight * _stretched(grid, NOISE_PX // cells)
    return np.asarray(np.clip(128 + total, 0, 255), dtype=np.uint8)


def _stretched(grid: NDArray[np.float32], times: int) -> NDArray[np.float32]:
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


def grain(width_px: int, height_px: int, key: int) -> Pixels:
    """A piece of the noise, chosen by the key."""
    y, x = key * 613 % NOISE_PX, key * 277 % NOISE_PX
    rows, columns = np.arange(y, y + height_px) % NOISE_PX, np.arange(x, x + width_px) % NOISE_PX
    source = noise()
    if y + height_px <= NOISE_PX and x + width_px <= NOISE_PX:
        return source[y : y + height_px, x : x + width_px]
    return source[rows[:, None], columns[None, :]]


@lru_cache(maxsize=4096)
def ramp(color: Color, contrast: float) -> Pixels:
    """(256, 3): the colour at 128, darker below and brighter above."""
    value = np.asarray(color, dtype=np.float32) * (1 + (np.arange(256, dtype=np.float32)[:, None] - 128) / 128 * contrast)
    return np.asarray(np.clip(value, 0, 255), dtype=np.uint8)


def colored(shade: Pixels, color: Color, contrast: float = 0.55) -> Pixels:
    """A grey picture in the shades of a colour."""
    return np.take(ramp(color, contrast), shade, axis=0)


def repeated(pattern: Pixels, width_px: int, height_px: int, key: int = 0) -> Pixels:
    """A pattern laid over an area, beginning at a place chosen by the key."""
    h, w = pattern.shape[:2]
    tall = np.take(pattern, np.arange(key % h, key % h + height_px) % h, axis=0)
    return np.asarray(np.take(tall, np.arange(key % w, key % w + width_px) % w, axis=1))


def blended(a: Pixels, b: Pixels) -> Pixels:
    """Two pictures around 128, added."""
    return np.asarray(np.clip(a.astype(np.int16) + b - 128, 0, 255), dtype=np.uint8)


@lru_cache(maxsize=64)
def tile_rows(px_per_m: float, row_m: float, column_m: float, relief: float) -> Pixels:
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


@lru_cache(maxsize=64)
def courses(px_per_m: float, row_m: float, column_m: float, joint: float, spread: float) -> Pixels:
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


def paint_roof(paint: Paint, width_px: int, height_px: int, px_per_m: float, key: int) -> Pixels:
    """Tiles, slates, metal sheets with seams, gravel or paving."""
    cover = next(iter(paint.traits))
    shade = grain(width_px, height_px, key)
    if cover in ("tiles", "dark", "roman"):
        relief = 1.3 if cover == "roman" else 0.9
        column = TILE_COLUMN_M * (1.6 if cover == "roman" else 1)
        shade = blended(repeated(tile_rows(px_per_m, TILE_ROW_M, column, relief), width_px, height_px, key), shade)
    elif cover == "slate":
        shade = blended(repeated(tile_rows(px_per_m, 0.25, 0.22, 0.5), width_px, height_px, key), shade)
    elif cover == "paving":
        shade = blended(repeated(courses(px_per_m, 0.5, 1.1, -30, 8), width_px, height_px, key), shade)
    picture = colored(shade, paint.colors[0], 0.8 if cover in ("tiles", "dark", "roman") else 0.5)
    if cover in ("metal", "copper"):
        seam = np.arange(0, width_px, max(3.0, 0.6 * px_per_m)).astype(int)
        picture[:, seam] = (picture[:, seam].astype(np.uint16) * 3 // 4).astype(np.uint8)
    return picture


def paint_facade(paint: Paint, width_px: int, height_px: int, px_per_m: float, key: int) -> Pixels:
    """A wall with its material, plinth, cornices, beams, windows, doors and shops."""
    picture = wall_ground(paint, width_px, height_px, px_per_m, key)
    canvas = Canvas(picture, paint, px_per_m)
    plinth_m = (paint.floors_m[0] if paint.floors_m else 0.0) + 0.45
    if "panel" not in paint.traits and "plain" not in paint.traits:
        canvas.rows(0, plinth_m, darker(paint.colors[0], 0.72), contrast=0.5)
    if "dado" in paint.traits and "plain" not in paint.traits:
        canvas.rows(plinth_m, plinth_m + 1.1, (150, 52, 40), contrast=0.5)
    if "shop" in paint.traits and len(paint.floors_m) > 1:
        canvas.rows(plinth_m, paint.floors_m[1] - 0.2, paint.colors[4], contrast=0.35)
        canvas.rows(paint.floors_m[1] - 0.75, paint.floors_m[1] - 0.3, darker(paint.colors[4], 0.75), contrast=0.2)
    if paint.traits & {"cornice", "panel"}:
        canvas.bands()
    if "timber" in paint.traits and "plain" not in paint.traits:
        canvas.beams(key)
    if "quoins" in paint.traits:
        canvas.quoins()
    for number, opening in enumerate(paint.openings):
        canvas.opening(opening, (key * 7 + number * 5) % 4)
    return picture


def wall_ground(paint: Paint, width_px: int, height_px: int, px_per_m: float, key: int) -> Pixels:
    """The bare wall: plaster, brick, ashlar, ribs or panels, darker towards its foot and under the eaves."""
    shade = grain(width_px, height_px, key)
    if "brick" in paint.traits:
        shade = blended(repeated(courses(px_per_m, 0.11, 0.32, 40, 18), width_px, height_px), shade)
    elif "ashlar" in paint.traits:
        shade = blended(repeated(courses(px_per_m, 0.45, 0.9, -40, 10), width_px, height_px), shade)
    elif "panel" in paint.traits:
        shade = blended(repeated(courses(px_per_m, 2.8, 3.0, -50, 3), width_px, height_px), shade)
    elif "ribs" in paint.traits:
        wave = (128 + 26 * np.sin(np.arange(width_px) * (2 * np.pi / max(2.5, 0.35 * px_per_m)))).astype(np.uint8)
        shade = blended(np.broadcast_to(wave, (height_px, width_px)), shade)
    height = (np.arange(height_px, 0, -1) - 0.5) / px_per_m
    dirt = 22 * np.exp(-height / 1.2) + 14 * np.exp(-(paint.height_m - height) / 0.5)
    shade = np.clip(shade.astype(np.int16) - dirt.astype(np.int16)[:, None], 0, 255).astype(np.uint8)
    return colored(shade, paint.colors[0], 0.32 if not paint.traits & {"brick", "ashlar"} else 0.6)


def darker(color: Color, factor: float) -> Color:
    """The colour times a factor."""
    r, g, b = (int(min(255, c * factor)) for c in color)
    return r, g, b


class Canvas:
    """Draws on a facade in metres from its lower left corner."""

    def __init__(self, picture: Pixels, paint: Paint, px_per_m: float) -> None:
        self.picture, self.paint, self.px_per_m = picture, paint, px_per_m
        self.height_px, self.width_px = picture.shape[:2]

    def y(self, z_m: float) -> int:
        return int(np.clip(round(self.height_px - z_m * self.px_per_m), 0, self.height_px))

    def x(self, s_m: float) -> int:
        return int(np.clip(round(s_m * self.px_per_m), 0, self.width_px))

    def rows(self, low_m: float, high_m: float, color: Color, contrast: float = 0.3) -> None:
        """A horizontal strip over the whole width."""
        top, bottom = self.y(high_m), self.y(low_m)
        if bottom > top:
            self.picture[top:bottom] = colored(grain(self.width_px, bottom - top, top), color, contrast)

    def bands(self) -> None:
        """A cornice with its shadow at each floor, a thicker one under the eaves."""
        for z in self.paint.floors_m[1:]:
            self.rows(z - 0.1, z + 0.1, self.paint.colors[1])
            self.rows(z - 0.2, z - 0.1, darker(self.paint.colors[0], 0.7))
        if "cornice" in self.paint.traits:
            self.rows(self.paint.height_m - 0.35, self.paint.height_m, self.paint.colors[1])

    def quoins(self) -> None:
        """Corner stones, long and short by turns."""
        color = np.asarray(self.paint.colors[1], dtype=np.uint8)
        step = 0.5
        for number, z in enumerate(np.arange(0, self.paint.height_m, step)):
            width = self.x(0.7 if number % 2 else 0.45)
            top, bottom = self.y(z + step * 0.92), self.y(z)
            self.picture[top:bottom, :width] = color
            self.picture[top:bottom, self.width_px - width :] = color

    def beams(self, key: int) -> None:
        """Half-timbering from the first floor up: posts, rails, and braces in some of the panels."""
        image = Image.fromarray(self.picture)
        draw = ImageDraw.Draw(image)
        thick = max(1, round(0.2 * self.px_per_m))
        floors = [*self.paint.floors_m[1:], self.paint.height_m]
        count = max(2, round(self.paint.width_m / 1.25))
        posts = [self.x(i * self.paint.width_m / count) for i in range(count + 1)]
        for low, high in itertools.pairwise(floors):
            top, bottom, middle = self.y(high), self.y(low), self.y(low * 0.62 + high * 0.38)
            for y in (bottom, middle, top):
                draw.line([(0, y), (self.width_px, y)], fill=TIMBER, width=thick)
            for i, x in enumerate(posts):
                draw.line([(x, bottom), (x, top)], fill=TIMBER, width=thick)
                if i < count and (key + i + bottom) % 3 == 0:
                    ends = [(x, bottom), (posts[i + 1], top)] if (key + i) % 2 else [(x, top), (posts[i + 1], bottom)]
                    draw.line(ends, fill=TIMBER, width=thick)
        self.picture[:] = np.asarray(image)

    def opening(self, opening: Opening, variant: int) -> None:
        """A window, arch, door, gate or shop with its surround; shutters where there is room."""
        x0, x1 = self.x(opening.left_m), self.x(opening.left_m + opening.width_m)
        y0, y1 = self.y(opening.low_m + opening.height_m), self.y(opening.low_m)
        if x1 - x0 < 2 or y1 - y0 < 2:
            return
        trim = max(1, round(0.13 * self.px_per_m))
        self.surround(opening, x0, x1, y0, y1, trim)
        stamp = leaf(opening.kind, x1 - x0, y1 - y0, self.px_per_m, self.paint.colors, variant)
        self.picture[y0:y1, x0:x1] = stamp
        if "shutters" in self.paint.traits and opening.kind == "window":
            self.shutters(x0, x1, y0, y1)

    def surround(self, opening: Opening, x0: int, x1: int, y0: int, y1: int, trim: int) -> None:
        """The frame of stone or wood around an opening, with a sill below a window."""
        if "timber" in self.paint.traits or "panel" in self.paint.traits:
            trim = max(1, trim // 2)
        color = TIMBER if "timber" in self.paint.traits else self.paint.colors[1]
        self.picture[max(0, y0 - trim) : y1, max(0, x0 - trim) : x1 + trim] = color
        if opening.kind == "window":
            sill = min(self.height_px, y1 + trim)
            self.picture[y1:sill, max(0, x0 - trim) : x1 + trim] = darker(color, 0.85)

    def shutters(self, x0: int, x1: int, y0: int, y1: int) -> None:
        """Two leaves with slats, open beside the window."""
        width = max(2, (x1 - x0) // 2 - 1)
        slats = 118 + 22 * (np.arange(y1 - y0) % max(2, round(0.09 * self.px_per_m)) == 0)
        leaf_px = colored(np.broadcast_to(slats[:, None].astype(np.uint8), (y1 - y0, width)), self.paint.colors[3])
        for start in (x0 - width - 1, x1 + 1):
            if start >= 0 and start + width <= self.width_px:
                self.picture[y0:y1, start : start + width] = leaf_px


@lru_cache(maxsize=8192)
def leaf(kind: str, width: int, height: int, px_per_m: float, colors: tuple[Color, ...], variant: int) -> Pixels:
    """The picture of a window, door or shop front, drawn at three times its size."""
    image = Image.new("RGB", (width * 3, height * 3), colors[2])
    draw = ImageDraw.Draw(image)
    bar = max(2.0, 0.07 * px_per_m * 3)
    if kind in ("door", "gate"):
        _door(draw, width * 3, height * 3, bar, darker(colors[3], 0.9 + 0.1 * variant), kind)
    else:
        across = {"shop": max(1, round(width / px_per_m / 1.3)), "window": 2, "arch": 2}[kind]
        upright = 1 if kind == "shop" else (3 if kind == "arch" else 2)
        _panes(draw, width * 3, height * 3, bar, across, upright, variant)
    if kind == "arch":
        _round_top(draw, width * 3, height * 3, colors[1])
    return np.asarray(image.resize((width, height), Image.Resampling.BOX))


def _panes(draw: ImageDraw.ImageDraw, w: int, h: int, bar: float, across: int, upright: int, variant: int) -> None:
    """Glass in panes: dark, with a brighter sky in its upper part, and curtains in some."""
    sky = [(96, 116, 132), (74, 92, 108), (120, 138, 150), (66, 76, 84)][variant]
    for i in range(across):
        for j in range(upright):
            x0, x1 = bar + i * (w - bar) / across, (i + 1) * (w - bar) / across
            y0, y1 = bar + j * (h - bar) / upright, (j + 1) * (h - bar) / upright
            if x1 <= x0 or y1 <= y0:
                continue
            shade = 1.15 - 0.5 * j / max(1, upright)
            draw.rectangle([x0, y0, x1, y1], fill=darker(sky, shade * 0.75))
            draw.polygon([(x0, y0), (x1, y0), (x0, y0 + (y1 - y0) * 0.7)], fill=darker(sky, shade))
            if variant == 2 and upright > 1 and i in (0, across - 1):
                edge = (x1 - x0) * 0.3
                draw.rectangle([x0, y0, x0 + edge, y1] if i == 0 else [x1 - edge, y0, x1, y1], fill=(222, 216, 204))


def _door(draw: ImageDraw.ImageDraw, w: int, h: int, bar: float, color: Color, kind: str) -> None:
    """A door with a fanlight and panels, or a gate of boards; `bar` is the width of its frame."""
    draw.rectangle([min(bar, w / 3), min(bar, h / 3), max(w - bar, w * 2 / 3), h], fill=color)
    if kind == "gate":
        for i in range(1, 7):
            draw.line([(w * i / 7, bar), (w * i / 7, h)], fill=darker(color, 0.75), width=max(1, int(bar / 2)))
        return
    draw.rectangle([w * 0.14, h * 0.05, w * 0.86, h * 0.2], fill=(86, 104, 118))
    for x0, x1 in ((0.14, 0.45), (0.55, 0.86)):
        for y0, y1 in ((0.27, 0.58), (0.65, 0.93)):
            draw.rectangle([w * x0, h * y0, w * x1, h * y1], fill=darker(color, 0.8), outline=darker(color, 1.25))


def _round_top(draw: ImageDraw.ImageDraw, w: int, h: int, color: Color) -> None:
    """Fills the corners above a round arch with the colour of the surround."""
    r = w / 2
    steps = np.linspace(0, np.pi / 2, 12)
    for sign in (-1, 1):
        corner = (r + sign * r, 0)
        arc = [(r + sign * r * np.cos(a), r - r * np.sin(a)) for a in steps]
        draw.polygon([corner, *arc], fill=color)
