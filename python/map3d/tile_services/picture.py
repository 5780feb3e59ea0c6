"""Draws a picture of any part of a stored view from its tiles (map3d.tile_services.picture_request)."""

import io
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from PIL import Image

from map3d.errors import Corrupt
from map3d.tile_services.daylight import light_at
from map3d.tile_services.picture_request import LIT, PictureRequest
from map3d.tiles.decode_tile import decode_tile, layer_with, paste, with_alpha
from map3d.tiles.light_colors import DEFAULT_LIGHT, PictureLight, Pixels, light_colors
from map3d.tiles.manifest import Manifest
from map3d.types import Layer, TileId

GetTile = Callable[[Layer, TileId], bytes | None]
"""(layer, tile) → the stored bytes; None for an empty tile."""

BACKGROUND: Final = (242, 240, 235)
"""Colour of the viewer's page around the model, in formats without transparency."""
QUALITY: Final = {"image/jpeg": 88, "image/webp": 85}
BAND_PX: Final = 256
"""Rows that are drawn at a time, which bounds the memory."""
MARGIN_PX: Final = 4
"""Pixels around a band that resampling reads."""


@dataclass(frozen=True)
class _Layers:
    """The layers that a picture is drawn from. `normal`: None for colours that stay as they are; `openness`: ambient occlusion, or None."""

    color: Layer
    normal: Layer | None
    openness: Layer | None
    light: PictureLight


def draw_picture(manifest: Manifest, request: PictureRequest, get_tile: GetTile) -> bytes:
    """Returns an encoded image. Raises Corrupt for a damaged tile, StoreError."""
    width, height = request.pixels
    layers = _choose_layers(manifest, request)
    mode, color = ("RGB", BACKGROUND) if request.media_type == "image/jpeg" else ("RGBA", (0, 0, 0, 0))
    with Image.new(mode, (width, height), color) as picture:
        for top in range(0, height, BAND_PX):
            rows = min(BAND_PX, height - top)
            band = _draw_band(manifest, request, get_tile, layers, top, rows)
            if band is not None:
                picture.paste(band, (0, top), band if mode == "RGB" else None)
        return _encode(picture, request.media_type)


def level_of(manifest: Manifest, request: PictureRequest) -> int:
    """Returns the level whose pixels are at most as large as those of the picture, as far as there is one."""
    zoom = request.zoom + math.log2(request.scale)
    return min(max(math.ceil(zoom - 1e-6), 0), manifest.zmax)


def _choose_layers(manifest: Manifest, request: PictureRequest) -> _Layers:
    name = "color" if request.style == LIT else request.style
    color = next(layer for layer in manifest.layers if layer.name == name)
    normal = layer_with(manifest.layers, "normal") if request.style == LIT else None
    light = DEFAULT_LIGHT if request.time is None else light_at(manifest, request.time)
    return _Layers(color, normal, layer_with(manifest.layers, "ao"), light)


def _draw_band(manifest: Manifest, request: PictureRequest, get_tile: GetTile, layers: _Layers, top: int, rows: int) -> Image.Image | None:
    """Returns rows of the picture as RGBA; None where nothing is."""
    frame, z = request.view.frame, level_of(manifest, request)
    u, v = request.centre_uv(manifest)
    width, height = request.pixels
    px, py = frame.level_pixel_from_uv(z, u - width / 2 * request.pixel_m, v + (height / 2 - top) * request.pixel_m)
    ratio = request.pixel_m / frame.pixel_m(z)
    left, upper, right, lower = float(px), float(py), float(px) + width * ratio, float(py) + rows * ratio
    window = (math.floor(left) - MARGIN_PX, math.floor(upper) - MARGIN_PX, math.ceil(right) + MARGIN_PX, math.ceil(lower) + MARGIN_PX)
    pixels = _read_window(request, get_tile, layers, z, window)
    if pixels is None:
        return None
    with Image.fromarray(pixels, "RGBA") as source:
        box = (left - window[0], upper - window[1], right - window[0], lower - window[1])
        if abs(ratio - 1) < 1e-6 and all(abs(edge - round(edge)) < 1e-3 for edge in box):
            x, y = round(box[0]), round(box[1])
            return source.crop((x, y, x + width, y + rows))
        return source.resize((width, rows), Image.Resampling.LANCZOS if ratio > 1 else Image.Resampling.BICUBIC, box)


def _read_window(request: PictureRequest, get_tile: GetTile, layers: _Layers, z: int, window: tuple[int, int, int, int]) -> Pixels | None:
    """Returns (H, W, 4) straight RGBA of a window of a level; None where no tile has content."""
    color = _Mosaic(request, z, window, 4)
    if not color.fill(get_tile, layers.color, layers.color.kind):
        return None
    if layers.normal is not None:
        normal = _Mosaic(request, z, window, 3)
        normal.fill(get_tile, layers.normal, "normal")
        openness = None
        if layers.openness is not None:
            mosaic = _Mosaic(request, z, window, 1)
            mosaic.fill(get_tile, layers.openness, "ao")
            openness = mosaic.pixels[..., 0]
        color.pixels[..., :3] = light_colors(color.pixels[..., :3], normal.pixels, layers.light, openness)
    return color.pixels


class _Mosaic:
    """The pixels of one kind in a window of a level: left, top, right and bottom in pixels of the level.

    `channels`: 1, 3 or 4; with one, nothing is 255, else 0.
    """

    def __init__(self, request: PictureRequest, z: int, window: tuple[int, int, int, int], channels: int) -> None:
        self._request, self._z = request, z
        self._left, self._top, right, bottom = window
        self.pixels: Pixels = np.full((bottom - self._top, right - self._left, channels), 255 if channels == 1 else 0, np.uint8)

    def fill(self, get_tile: GetTile, layer: Layer, kind: str) -> bool:
        """Returns whether any tile has content."""
        found = False
        side = self._request.view.frame.tile_px
        rows, columns = (_tiles(start, size, side, self._z) for start, size in ((self._top, len(self.pixels)), (self._left, self.pixels.shape[1])))
        for tile in (TileId(self._z, x, y) for y in rows for x in columns):
            data = get_tile(layer, tile) if tile in self._request.view.occupancy else None
            if data is not None:
                paste(self.pixels, self._decode(layer, kind, data, tile), tile.x * side - self._left, tile.y * side - self._top)
                found = True
        return found

    def _decode(self, layer: Layer, kind: str, data: bytes, tile: TileId) -> Pixels:
        try:
            pixels = decode_tile(layer, data, self._request.view.frame.tile_px)[kind]
        except Corrupt as error:
            raise Corrupt(f"tile {layer.name}/{tile.z}/{tile.x}/{tile.y}: {error}; run: map3d verify") from error
        channels = self.pixels.shape[2]
        return with_alpha(pixels) if channels == 4 else pixels.reshape(*pixels.shape[:2], channels)


def _tiles(start: int, size: int, side: int, z: int) -> range:
    """Returns the columns or rows of tiles that an interval of pixels touches."""
    return range(max(start // side, 0), min(-(-(start + size) // side), 1 << z))


def _encode(picture: Image.Image, media_type: str) -> bytes:
    data = io.BytesIO()
    options = {} if media_type == "image/png" else {"quality": QUALITY[media_type]}
    picture.save(data, media_type.partition("/")[2].upper(), **options)
    return data.getvalue()
