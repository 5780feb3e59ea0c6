"""Pixels of a pyramid, put together from the stored tiles: what clients of the tile services have to show."""

import io

import numpy as np
from PIL import Image

from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import DEPTH_UNIT_M, TileId


class PyramidPixels:
    def __init__(self, workspace, manifest, view):
        self.manifest, self.view = manifest, manifest.view(view)
        self.frame = self.view.frame
        self._path = workspace.store_path(manifest.name, view)

    def level(self, layer, z):
        """Returns (H, W, 4) uint8 of a whole level; empty tiles are 0."""
        side = self.manifest.tile_px << z
        with SqliteTileStore(self._path, read_only=True) as store, Image.new("RGBA", (side, side)) as whole:
            number = store.shape.layer_number(layer)
            for tile in self.view.occupancy.tiles(z):
                with Image.open(io.BytesIO(store.get_tile(number, *tile))) as picture:
                    whole.paste(picture.convert("RGBA"), (tile.x * self.manifest.tile_px, tile.y * self.manifest.tile_px))
            return np.asarray(whole)

    def depth(self):
        """Returns the depths of the deepest level in metres from D0, NaN without a surface."""
        units = self.level("depth", self.manifest.zmax).view("<u4")[..., 0]
        return np.where(units == 0xFFFFFFFF, np.nan, units * DEPTH_UNIT_M)

    def world(self, column, row):
        """Returns the world position that a pixel of the deepest level shows."""
        px = self.manifest.tile_px
        tile = TileId(self.manifest.zmax, column // px, row // px)
        depth = self.depth()[row, column] / DEPTH_UNIT_M
        return self.frame.local_from_pixel(tile, column % px, row % px, depth) + np.array(self.manifest.origin)


def over_magenta(rgba):
    """Returns (H, W, 3) of pixels above an opaque background, as programs with a magenta background show them."""
    alpha = rgba[..., 3:].astype(float) / 255
    return np.rint(rgba[..., :3] * alpha + np.array([255, 0, 255]) * (1 - alpha)).astype(np.uint8)


def difference(a, b):
    """Returns the share of pixels that differ by more than 12 of 255 in a channel."""
    return float((np.abs(a.astype(int) - b.astype(int)).max(axis=-1) > 12).mean())
