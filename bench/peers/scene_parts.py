"""Reads the input of all peers: the triangles of a built scene, one part per material, with the textures of the build."""

import hashlib
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.geometry.views import Axes, axes
from map3d.types import ViewAngles
from tests.oracle.asset_reader import read_asset

from . import FrameFields


@dataclass(frozen=True)
class MaterialPart:
    """The triangles of a material: corners (n, 3, 3) local; uvs (n, 3, 2), v up; object ids (n,); image (H, W, 3) sRGB or None; diffuse sRGB."""

    corners: NDArray[np.float64]
    uvs: NDArray[np.float32]
    ids: NDArray[np.uint32]
    image: NDArray[np.uint8] | None
    diffuse: tuple[float, float, float]
    repeats: bool


def read_parts(folder: Path) -> Iterator[MaterialPart]:
    """Yields the parts of all assets without prototypes; the scene must not have instances."""
    origin = np.array(json.loads((folder / "scene.json").read_text())["origin"])
    images = filled_images(folder)
    for path in sorted(folder.glob("assets/*/mesh.m3a")):
        asset = read_asset(path.parent)
        for number, material in enumerate(asset.materials):
            chosen = np.flatnonzero((asset.material == number) & (asset.prototype == 0))
            if len(chosen) == 0:
                continue
            corners = asset.positions[asset.triangles[chosen]] - origin
            yield MaterialPart(corners, asset.uvs[chosen], asset.ids[asset.object[chosen]], *_read_material(material, images))


def _read_material(material: dict[str, Any], images: dict[str, Path]) -> tuple[NDArray[np.uint8] | None, tuple[float, float, float], bool]:
    key = material["texture"]
    image = None if key is None else np.ascontiguousarray(_core.texture_level(str(images[key]), 0)[..., :3])
    red, green, blue = material["diffuse"][:3]
    return image, (red, green, blue), material["wrap"] in ("wrap", "mirror")


@cache
def filled_images(folder: Path) -> dict[str, Path]:
    """Returns the built textures by key of their source image."""
    found = {}
    for path in sorted((folder / "textures").glob("*/*.m3t")):
        data = path.read_bytes()
        offset, length = (int(number) for number in np.frombuffer(data, "<u8", 2, 64))
        found[hashlib.sha256(data[offset : offset + length]).hexdigest()[:32]] = path
    return found


@dataclass(frozen=True)
class TileSquare:
    """The square of a tile: centre (u, v) and side in metres, side in pixels, axes of the view."""

    u_m: float
    v_m: float
    side_m: float
    px: int
    axes: Axes


def tile_square(frame: FrameFields, x: int, y: int) -> TileSquare:
    side = frame["size_m"] / 2 ** frame["zmax"]
    view = axes(ViewAngles(frame["look_at_deg"], frame["pitch_deg"]))
    return TileSquare(frame["u0_m"] + (x + 0.5) * side, frame["v0_m"] - (y + 0.5) * side, side, frame["tile_px"], view)


def depth_range(lo: NDArray[np.float64], hi: NDArray[np.float64], view: Axes) -> tuple[float, float]:
    """Returns the depths D of planes in front of and behind a box, with a margin of one metre."""
    centre, half = (lo + hi) / 2, (hi - lo) / 2
    middle, reach = float(centre @ view.forward), float(half @ np.abs(view.forward))
    return math.floor(middle - reach) - 1.0, math.ceil(middle + reach) + 1.0


def linear_from_srgb(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb_bytes_from_linear(light: NDArray[np.floating]) -> NDArray[np.uint8]:
    """Converts linear light 0..1 to sRGB bytes."""
    light = np.clip(light, 0, 1)
    return np.round(255 * np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)).astype(np.uint8)
