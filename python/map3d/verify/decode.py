"""Decodes stored tiles, for checks."""

import io
from typing import Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from map3d.errors import Corrupt
from map3d.types import Layer

_FORMATS: Final = {"webp": "WEBP", "png": "PNG", "jpeg": "JPEG"}
_MODES: Final = {"normal": ("RGB",), "id": ("RGBA",), "depth": ("RGBA",), "depth2": ("RGBA",), "sun": ("L",), "ao": ("L",), "sun16": ("LA",)}
_COLOR_MODES: Final = ("RGB", "RGBA")


def decode_tile(layer: Layer, data: bytes, tile_px: int) -> NDArray[np.uint8]:
    """Returns (H, W, C) pixels; raises Corrupt unless the bytes are an image of the layer's format, mode and size."""
    try:
        with Image.open(io.BytesIO(data), formats=[_FORMATS[layer.format]]) as image:
            pixels = np.asarray(image)
            mode = image.mode
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise Corrupt(f"not a {layer.format} image: {error}") from error
    modes = _MODES.get(layer.kind, _COLOR_MODES)
    if pixels.shape[:2] != (tile_px, tile_px) or mode not in modes:
        raise Corrupt(f"{mode} of {pixels.shape[1]} × {pixels.shape[0]} px, expected {' or '.join(modes)} of {tile_px} × {tile_px}")
    return pixels.reshape(tile_px, tile_px, -1)


def ids_of(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Returns the distinct object ids of an id tile, without 0 (nothing)."""
    ids = np.unique(np.ascontiguousarray(pixels).view(np.dtype("<u4")))
    return np.asarray(ids[ids != 0], dtype=np.uint32)
