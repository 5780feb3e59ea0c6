"""Lights colours by normals and ambient occlusion as the viewer does."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from map3d.types import Vec3

AMBIENT: Final = 0.42
DIFFUSE: Final = 0.76
"""Factor of the viewer's direct light on a surface that faces the sun."""
WHITE: Final = (1.0, 1.0, 1.0)

Pixels = NDArray[np.uint8]

_BAND_ROWS: Final = 64
"""Rows that are lit at a time: a picture of 1,200 × 630 takes a few MB in place of 200."""


@dataclass(frozen=True)
class PictureLight:
    """`towards`: unit vector to the sun in local axes; `sun_rgb`, `sky_rgb`: factors of direct and ambient light."""

    towards: Vec3
    sun_rgb: Vec3 = WHITE
    sky_rgb: Vec3 = WHITE


def direction(azimuth_deg: float, elevation_deg: float) -> Vec3:
    """Returns the unit vector of an azimuth clockwise from the local y axis and an elevation."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (math.sin(azimuth) * math.cos(elevation), math.cos(azimuth) * math.cos(elevation), math.sin(elevation))


DEFAULT_LIGHT: Final = PictureLight(direction(215.0, 48.0))
"""The viewer's default light."""


def light_colors(rgb: Pixels, normals: Pixels, light: PictureLight = DEFAULT_LIGHT, openness: Pixels | None = None) -> Pixels:
    """Returns sRGB colours in a light of the viewer. Half of a pixel's light is its own, an eighth comes from each neighbour, because colours
    along edges are mixtures. Pixels without a normal have skylight and half of the sunlight.

    `openness`: the layer `ao`, (H, W); None: all is open to the sky.
    """
    lit = np.empty_like(rgb)
    for start in range(0, len(rgb), _BAND_ROWS):
        rows, halo = slice(start, start + _BAND_ROWS), slice(max(start - 1, 0), start + _BAND_ROWS + 1)
        beam = _beam(normals[halo], light.towards)[rows.start - halo.start :][:_BAND_ROWS]
        sky = np.float32(AMBIENT) if openness is None else (openness[rows] * np.float32(AMBIENT / 255))[..., None]
        factors = np.array(light.sky_rgb, np.float32) * sky + np.array(light.sun_rgb, np.float32) * np.float32(DIFFUSE) * beam
        linear = _LINEAR[rgb[rows]] * factors
        lit[rows] = _SRGB[np.rint(np.clip(linear, 0, 1) * (len(_SRGB) - 1)).astype(np.uint16)]
    return lit


def _beam(normals: Pixels, towards: Vec3) -> NDArray[np.float32]:
    """Returns the part of the sunlight that each pixel gets, (H, W, 1), 0 to 1."""
    has_normal = normals.any(axis=-1)
    unit = normals.astype(np.float32) / 127.5 - 1
    unit /= np.maximum(np.linalg.norm(unit, axis=-1, keepdims=True), 1e-6)
    own = np.where(has_normal, np.maximum(unit @ np.array(towards, np.float32), 0), np.nan)
    return np.where(has_normal, _spread(own), 0.5)[..., None].astype(np.float32)


def _spread(own: NDArray[np.float32]) -> NDArray[np.float32]:
    padded = np.pad(own, 1, mode="edge")
    neighbours = (padded[1:-1, :-2], padded[1:-1, 2:], padded[:-2, 1:-1], padded[2:, 1:-1])
    return 0.5 * own + 0.125 * sum(np.where(np.isnan(one), own, one) for one in neighbours)


def linear_table() -> NDArray[np.float64]:
    """Returns the linear light of each sRGB byte (IEC 61966-2-1)."""
    c = np.arange(256) / 255
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def _srgb_table() -> Pixels:
    """Returns the sRGB byte of each of 4,096 evenly spaced steps of linear light."""
    c = np.arange(4096) / 4095
    srgb = np.where(c <= 0.0031308, c * 12.92, 1.055 * c ** (1 / 2.4) - 0.055)
    table: Pixels = np.rint(255 * srgb).astype(np.uint8)
    return table


_LINEAR: Final = linear_table().astype(np.float32)
_SRGB: Final = _srgb_table()
