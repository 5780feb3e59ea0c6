"""Draws the textures of leaf cards."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from map3d_town.models.building_model import Color
from map3d_town.models.tree_prototypes import SPECIES
from map3d_town.polygons_2d import Points
from map3d_town.seeds import rng

LEAF_PX = 256


def draw_leaf_texture(name: str) -> NDArray[np.uint8]:
    """Returns (256, 256, 4) uint8: leaves in the crown's silhouette. Alpha is 0 or 255; transparent pixels have the leaf colour."""
    species, view = name.rsplit("_", 1)
    _, _, color, shape = SPECIES[species]
    source = rng(11, "leaves", name)
    big = LEAF_PX * 2
    image = Image.new("RGBA", (big, big), (*_shade_color(color, 0.7), 0))
    draw = ImageDraw.Draw(image)
    points = source.uniform(0, 1, (3600, 2))
    inside = points[_in_crown(points, shape if view == "side" else "disc", source)]
    clumps = source.uniform(0.1, 0.9, (26, 2))
    order = np.argsort(inside[:, 1] if view == "side" else -np.hypot(*(inside - 0.5).T))
    for x, y in inside[order]:
        near = float(np.hypot(*(clumps - [x, y]).T).min())
        light = (
            0.62 + 0.5 * y + source.normal(0, 0.13) - 1.1 * min(near, 0.2)
            if view == "side"
            else 1.12 + source.normal(0, 0.14) - 1.4 * min(near, 0.25)
        )
        size = source.uniform(7, 14)
        box = [x * big - size, (1 - y) * big - size * 0.7, x * big + size, (1 - y) * big + size * 0.7]
        draw.ellipse(box, fill=(*_shade_color(color, light), 255))
    small = np.asarray(image.resize((LEAF_PX, LEAF_PX), Image.Resampling.BOX)).copy()
    small[..., 3] = np.where(small[..., 3] >= 128, 255, 0)
    small[small[..., 3] == 0, :3] = _shade_color(color, 0.7)
    return small


def _in_crown(points: Points, shape: str, source: np.random.Generator) -> NDArray[np.bool_]:
    """Returns a mask of the points in the silhouette, with a ragged edge."""
    x, y = (points[:, 0] - 0.5) * 2, points[:, 1]
    ragged = 1 + 0.1 * np.sin(9 * np.arctan2(y - 0.5, x)) + source.normal(0, 0.05, len(x))
    reach = {
        "round": np.sqrt(np.clip(1 - (2 * y - 1) ** 2, 0, 1)), "disc": np.sqrt(np.clip(1 - (2 * y - 1) ** 2, 0, 1)),
        "column": np.sin(np.pi * np.clip(y, 0, 1) ** 0.8) ** 0.9,
        "cone": (1 - y) * (0.78 + 0.22 * np.cos(y * 34)), "umbrella": np.sqrt(np.clip(1 - (2 * y - 1) ** 2, 0, 1)) * 0.97,
    }[shape]  # fmt: skip
    return np.asarray(np.abs(x) < reach * np.minimum(ragged * 0.93, 1.0))


def _shade_color(color: Color, light: float) -> Color:
    r, g, b = (min(255, max(0, int(c * light))) for c in color)
    return r, g, b
