"""Draws windows, doors and shop fronts; equal ones are drawn once."""

from functools import lru_cache

import numpy as np
from PIL import Image, ImageDraw

from map3d_town.models.facade_design import Color
from map3d_town.textures.noise_patterns import PackedImage, from_image


def draw_opening_texture(kind: str, width: int, height: int, px_per_m: float, colors: tuple[Color, ...], variant: int) -> PackedImage:
    """Draws a window, door or shop front; `colors` are those of a facade."""
    door = colors[3] if kind in ("door", "gate") else None
    around = colors[1] if kind == "arch" else None
    return _draw_cached(kind, width, height, px_per_m, colors[2], door, around, variant)


@lru_cache(maxsize=16384)
def _draw_cached(
    kind: str, width: int, height: int, px_per_m: float, frame: Color, door: Color | None, around: Color | None, variant: int
) -> PackedImage:
    """Draws with 3 × 3 supersampling. Cached, because thousands of facades share a few hundred openings."""
    image = Image.new("RGB", (width * 3, height * 3), frame)
    draw = ImageDraw.Draw(image)
    bar = max(2.0, 0.07 * px_per_m * 3)
    if door is not None:
        _draw_door(draw, width * 3, height * 3, bar, scale_color(door, 0.9 + 0.1 * variant), kind)
    else:
        across = {"shop": max(1, round(width / px_per_m / 1.3)), "window": 2, "arch": 2}[kind]
        upright = 1 if kind == "shop" else (3 if kind == "arch" else 2)
        _draw_panes(draw, width * 3, height * 3, bar, across, upright, variant)
    if around is not None:
        _draw_arch_corners(draw, width * 3, height * 3, around)
    return from_image(image.resize((width, height), Image.Resampling.BOX))


def scale_color(color: Color, factor: float) -> Color:
    """Multiplies a colour by a factor."""
    r, g, b = color
    return min(255, int(r * factor)), min(255, int(g * factor)), min(255, int(b * factor))


def _draw_panes(draw: ImageDraw.ImageDraw, w: int, h: int, bar: float, across: int, upright: int, variant: int) -> None:
    """Draws dark panes with a brighter reflection of the sky, some with curtains."""
    sky = [(96, 116, 132), (74, 92, 108), (120, 138, 150), (66, 76, 84)][variant]
    for i in range(across):
        for j in range(upright):
            x0, x1 = bar + i * (w - bar) / across, (i + 1) * (w - bar) / across
            y0, y1 = bar + j * (h - bar) / upright, (j + 1) * (h - bar) / upright
            if x1 <= x0 or y1 <= y0:
                continue
            shade = 1.15 - 0.5 * j / max(1, upright)
            draw.rectangle([x0, y0, x1, y1], fill=scale_color(sky, shade * 0.75))
            draw.polygon([(x0, y0), (x1, y0), (x0, y0 + (y1 - y0) * 0.7)], fill=scale_color(sky, shade))
            if variant == 2 and upright > 1 and i in (0, across - 1):
                edge = (x1 - x0) * 0.3
                draw.rectangle([x0, y0, x0 + edge, y1] if i == 0 else [x1 - edge, y0, x1, y1], fill=(222, 216, 204))


def _draw_door(draw: ImageDraw.ImageDraw, w: int, h: int, bar: float, color: Color, kind: str) -> None:
    """Draws a door with fanlight and panels, or a gate of boards; `bar`: width of the frame."""
    draw.rectangle([min(bar, w / 3), min(bar, h / 3), max(w - bar, w * 2 / 3), h], fill=color)
    if kind == "gate":
        for i in range(1, 7):
            draw.line([(w * i / 7, bar), (w * i / 7, h)], fill=scale_color(color, 0.75), width=max(1, int(bar / 2)))
        return
    draw.rectangle([w * 0.14, h * 0.05, w * 0.86, h * 0.2], fill=(86, 104, 118))
    for x0, x1 in ((0.14, 0.45), (0.55, 0.86)):
        for y0, y1 in ((0.27, 0.58), (0.65, 0.93)):
            draw.rectangle([w * x0, h * y0, w * x1, h * y1], fill=scale_color(color, 0.8), outline=scale_color(color, 1.25))


def _draw_arch_corners(draw: ImageDraw.ImageDraw, w: int, h: int, color: Color) -> None:
    """Fills the corners above a round arch with the colour of the surround."""
    r = w / 2
    steps = np.linspace(0, np.pi / 2, 12)
    for sign in (-1, 1):
        corner = (r + sign * r, 0)
        arc = [(r + sign * r * np.cos(a), r - r * np.sin(a)) for a in steps]
        draw.polygon([corner, *arc], fill=color)
