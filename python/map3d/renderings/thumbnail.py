"""The thumbnail of a view: a picture in a few hundred bytes, which viewers show until the first tiles arrive (spec/manifest.md).

It is made of the coarsest tiles, in the viewer's default light. Equal tiles give equal bytes on every machine: what functions of a mathematical
library return is rounded first, and the rest are single operations on float64.
"""

import base64
from functools import reduce
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from map3d import _core
from map3d.errors import Corrupt
from map3d.tiles.decode_tile import decode_tile, layer_with, paste, with_alpha
from map3d.tiles.light_colors import AMBIENT, DEFAULT_LIGHT, DIFFUSE, linear_table
from map3d.tiles.manifest import Thumbnail
from map3d.tiles.tile_store import TileStore
from map3d.types import COLOR_KINDS, TileId

SIDE_PX: Final = 64
"""Longest side, at most."""
QUALITY: Final = 25
LEVELS: Final = 3
"""Levels from the top that may be read: the first on which the content is as large as the thumbnail."""
_LINEAR: Final = np.rint(linear_table() * 65535)
_SUN: Final = tuple(round(axis, 9) for axis in DEFAULT_LIGHT.towards)


def make_thumbnail(store: TileStore) -> Thumbnail | None:
    """Returns None if there are no colours or no tiles, or if one of the tiles is damaged, which `map3d verify` reports."""
    try:
        extent = _find_extent(_Level(store, 0).read("id", "color", "picture"))
        if extent is None:
            return None
        left, top, right, bottom = extent
        side = max(right - left, bottom - top)
        z = next((z for z in range(LEVELS) if side << z >= SIDE_PX or z == store.shape.zmax), LEVELS - 1)
        step = -(-(side << z) // SIDE_PX)
        width, height = (-(-(length << z) // step) for length in (right - left, bottom - top))
        level = _Level(store, z, (left << z, top << z, width * step, height * step))
        colors = level.read("color", "picture")
        if colors is None:
            return None
        light = _light(level.read("normal"), colors) if layer_with(store.shape.layers, "color") else np.ones(colors.shape[:2])
    except Corrupt:
        return None
    scale = step / 2**z
    return Thumbnail((left, top, width * scale, height * scale), base64.b64encode(_encode(colors, light, step)).decode())


class _Level:
    """Pixels of a level of a store. `window`: (left, top, width, height); None: the whole level."""

    def __init__(self, store: TileStore, z: int, window: tuple[int, int, int, int] | None = None) -> None:
        self._store, self._z = store, z
        side = store.shape.tile_px << z
        self._window = window or (0, 0, side, side)

    def read(self, *kinds: str) -> NDArray[Any] | None:
        """Returns the first of the kinds that the store has: colours with alpha, id and normal as decoded, 0 where no tile is. Raises Corrupt."""
        found = next(((kind, layer) for kind in kinds if (layer := layer_with(self._store.shape.layers, kind))), None)
        if found is None:
            return None
        kind, layer = found
        left, top, width, height = self._window
        tile_px, number = self._store.shape.tile_px, self._store.shape.layer_number(layer.name)
        channels = {"id": (), "normal": (3,)}.get(kind, (4,))
        window: NDArray[Any] = np.zeros((height, width, *channels), np.uint32 if kind == "id" else np.uint8)
        columns, rows = (
            range(start // tile_px, min(-(-(start + length) // tile_px), 1 << self._z)) for start, length in ((left, width), (top, height))
        )
        for x, y in product(columns, rows):
            data = self._store.get_tile(number, *TileId(self._z, x, y))
            if data is not None:
                pixels = decode_tile(layer, data, tile_px)[kind]
                paste(window, with_alpha(pixels) if kind in COLOR_KINDS else pixels, x * tile_px - left, y * tile_px - top)
        return window


def _find_extent(pixels: NDArray[Any] | None) -> tuple[int, int, int, int] | None:
    """Returns (left, top, right, bottom) of the covered pixels, of ids or colours; None if all are empty."""
    covered = np.zeros((1, 1), bool) if pixels is None else (pixels if pixels.ndim == 2 else pixels[..., 3]) > 0
    if not covered.any():
        return None
    columns, rows = (np.flatnonzero(covered.any(axis=axis)) for axis in (0, 1))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _light(normals: NDArray[np.uint8] | None, colors: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Returns the light on each pixel. Pixels without a normal have half of the sunlight."""
    if normals is None:
        return np.full(colors.shape[:2], AMBIENT + DIFFUSE / 2)
    x, y, z = (normals[..., axis] / 127.5 - 1 for axis in range(3))
    beam = np.where(normals.any(axis=-1), np.maximum(x * _SUN[0] + y * _SUN[1] + z * _SUN[2], 0), 0.5)
    return AMBIENT + DIFFUSE * beam


def _encode(colors: NDArray[np.uint8], light: NDArray[np.float64], step: int) -> bytes:
    """Shrinks lit colours by `step`, as means in linear light weighted by coverage, and encodes them."""
    alpha = colors[..., 3:] / 255
    linear = np.minimum(_LINEAR[colors[..., :3]] * light[..., None], 65535) * alpha
    premultiplied = np.concatenate([linear, alpha * 65535], axis=-1)
    rows = reduce(np.add, (premultiplied[k::step] for k in range(step)))
    cells = reduce(np.add, (rows[:, k::step] for k in range(step))) / step**2
    return _core.encode_layer("color", "webp", np.rint(cells).astype(np.uint16), QUALITY)
