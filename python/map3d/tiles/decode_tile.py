"""Decodes stored tiles into arrays: images, and data tiles (spec/pyramid.md §6, spec/data-tile.md). All parts that read pixels do it here."""

import io
from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d import _core
from map3d.errors import Corrupt
from map3d.types import DATA_TILE_KINDS, LAYERS, Layer

Arrays = Mapping[str, NDArray[Any]]

_FORMATS: Final = {"webp": "WEBP", "png": "PNG", "jpeg": "JPEG"}
_MODES: Final = {"uint16x4": ("RGB", "RGBA"), "int16x3": ("RGB",), "uint32": ("RGBA",), "uint16": ("LA",), "uint8": ("L",)}
"""Modes of the images of arrays, by the type of their pixels."""
_NUMBERS: Final = {"uint32": "<u4", "uint16": "<u2"}
"""Types whose channels are the bytes of a number."""


def kinds_of(layer: Layer) -> tuple[str, ...]:
    """Returns the kinds of pixels that the tiles of a layer hold."""
    return LAYERS[layer.kind].holds or (layer.kind,)


def layer_with(layers: Iterable[Layer], kind: str) -> Layer | None:
    """Returns the first layer whose tiles hold a kind of pixels, or None."""
    return next((layer for layer in layers if kind in kinds_of(layer)), None)


def find_layer(layers: Iterable[Layer], name: str) -> tuple[Layer, Layer] | None:
    """Returns the layer that a name means, and the stored one that has its pixels, or None.

    They are the same, but where a rendering has data tiles, `normal`, `id` and `depth` mean the PNG layers that `as_layer` makes of them.
    """
    known = tuple(layers)
    stored = next((layer for layer in known if layer.name == name), None)
    if stored is not None:
        return stored, stored
    holder = next((layer for layer in known if layer.kind == "data"), None) if name in DATA_TILE_KINDS else None
    return None if holder is None else (_png_layer(holder, name), holder)


def layer_names(layers: Iterable[Layer]) -> list[str]:
    """Returns the names for which `find_layer` finds a layer: the stored ones, then those made of data tiles."""
    known = tuple(layers)
    stored = [layer.name for layer in known]
    return [*stored, *(name for name in DATA_TILE_KINDS if name not in stored and find_layer(known, name) is not None)]


def decode_tile(layer: Layer, data: bytes, tile_px: int) -> Arrays:
    """Returns an array for each of the layer's kinds of pixels, of tile_px × tile_px: (H, W, 3 or 4) uint8 for colours,
    (H, W, 3) uint8 for normals, (H, W) of the type in spec/layers.json for the others. Raises Corrupt unless the bytes are a tile of the layer's
    format, mode and size."""
    if layer.kind == "data":
        return _decode_data(data, tile_px)
    channels, number = decode_channels(layer, data, tile_px), _NUMBERS.get(_pixel(layer))
    if number is not None:
        return {layer.kind: channels.view(number)[..., 0]}
    return {layer.kind: channels[..., 0] if channels.shape[2] == 1 else channels}


def decode_channels(layer: Layer, data: bytes, tile_px: int) -> NDArray[np.uint8]:
    """Returns the bytes of an image's channels, (H, W, C). Raises Corrupt as `decode_tile` does."""
    modes = _MODES[_pixel(layer)]
    try:
        with Image.open(io.BytesIO(data), formats=[_FORMATS[layer.format]]) as image:
            if image.size != (tile_px, tile_px) or image.mode not in modes:
                found = f"{image.mode} of {image.width} × {image.height} px"
                raise Corrupt(f"{found}, expected {' or '.join(modes)} of {tile_px} × {tile_px}")
            return np.ascontiguousarray(image).reshape(tile_px, tile_px, -1)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise Corrupt(f"not a {layer.format} image: {error}") from error


def as_layer(asked: Layer, stored: Layer, data: bytes, tile_px: int, where: str) -> bytes:
    """Returns a tile of `stored` as one of `asked`, as `find_layer` returned them: the same bytes as where that layer is stored. Raises Corrupt, with
    `where` in the message."""
    if asked is stored:
        return data
    try:
        pixels = decode_tile(stored, data, tile_px)[asked.kind]
    except Corrupt as error:
        raise Corrupt(f"{where}: {error}; run: map3d verify") from error
    return _encode_png(asked, pixels)


def with_alpha(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Returns (H, W, 4); alpha is 255 for tiles without it."""
    return color if color.shape[2] == 4 else np.concatenate([color, np.full((*color.shape[:2], 1), 255, np.uint8)], axis=2)


def paste(into: NDArray[Any], tile: NDArray[Any], x: int, y: int) -> None:
    """Copies the part of a tile that lies in a larger array; (x, y): the tile's corner there."""
    height, width = into.shape[:2]
    left, top, right, bottom = max(x, 0), max(y, 0), min(x + tile.shape[1], width), min(y + tile.shape[0], height)
    into[top:bottom, left:right] = tile[top - y : bottom - y, left - x : right - x]


def _png_layer(holder: Layer, name: str) -> Layer:
    return Layer(name, name, "png", small=holder.small)


def _pixel(layer: Layer) -> str:
    array = LAYERS[layer.kind].array
    assert array is not None, "a layer with an array of its own"
    return array.pixel


def _decode_data(data: bytes, tile_px: int) -> Arrays:
    try:
        arrays: dict[str, NDArray[Any]] = _core.decode_data_tile(data)
    except _core.CoreError as error:
        raise Corrupt(str(error)) from error
    height, width = arrays["id"].shape
    if (height, width) != (tile_px, tile_px):
        raise Corrupt(f"data tile of {width} × {height} px, expected {tile_px} × {tile_px}")
    return arrays


def _encode_png(layer: Layer, pixels: NDArray[Any]) -> bytes:
    channels = np.ascontiguousarray(pixels[..., None]).view(np.uint8) if _pixel(layer) in _NUMBERS else np.ascontiguousarray(pixels)
    return _core.encode_png(layer.kind, channels, range(channels.shape[2]), layer.small)
