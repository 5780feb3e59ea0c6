"""Decoding of stored tiles and seams, for checks."""

import io
import struct
from collections.abc import Sequence
from typing import Final

import numpy as np
import xxhash
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from map3d.errors import Corrupt
from map3d.types import LAYER_KINDS, Layer

SEAM_MAGIC: Final = b"M3DG"
SEAM_VERSION: Final = 2
_SEAM_HEAD: Final = struct.Struct("<4sIIII")
_ALWAYS: Final = ("id", "depth")
_FORMATS: Final = {"webp": "WEBP", "png": "PNG", "jpeg": "JPEG"}
_MODES: Final = {"normal": ("RGB",), "id": ("RGBA",), "depth": ("RGBA",), "depth2": ("RGBA",), "sun": ("L",), "ao": ("L",), "sun16": ("LA",)}
_COLOR_MODES: Final = ("RGB", "RGBA")


def decode_tile(layer: Layer, data: bytes, tile_px: int) -> NDArray[np.uint8]:
    """(H, W, C) pixels; raises Corrupt unless the bytes are an image of the layer's format, mode and size."""
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
    """Distinct object ids of an id tile, without nothing (0)."""
    ids = np.unique(np.ascontiguousarray(pixels).view(np.dtype("<u4")))
    return np.asarray(ids[ids != 0], dtype=np.uint32)


def seam_arrays(layers: Sequence[Layer]) -> int:
    """Which arrays the seams of a pass have: bit k for kind k of LAYER_KINDS, the row of its array in spec/pyramid.md §5."""
    return sum(1 << LAYER_KINDS.index(kind) for kind in {*_ALWAYS, *(layer.kind for layer in layers)})


def check_seam(data: bytes, tile_px: int, layers: Sequence[Layer]) -> None:
    """Raises Corrupt unless head, lengths and checksum are right for a pass of these layers (spec/pyramid.md §8)."""
    if len(data) < _SEAM_HEAD.size + 8:
        raise Corrupt(f"seam of {len(data)} bytes")
    magic, version, width, height, arrays = _SEAM_HEAD.unpack_from(data)
    if (magic, version, width, height) != (SEAM_MAGIC, SEAM_VERSION, tile_px, tile_px):
        raise Corrupt(
            f"seam {magic!r} version {version} of {width} × {height} px, expected {SEAM_MAGIC!r} version {SEAM_VERSION} of {tile_px} × {tile_px}"
        )
    expected = seam_arrays(layers)
    if arrays != expected:
        raise Corrupt(f"seam with arrays {arrays:#b}, expected {expected:#b} ({', '.join(layer.kind for layer in layers)}, and id and depth)")
    at = _SEAM_HEAD.size
    for _ in range(arrays.bit_count()):
        if at + 4 > len(data) - 8:
            raise Corrupt(f"seam ends after {len(data)} bytes, within an array")
        at += 4 + int.from_bytes(data[at : at + 4], "little")
    if at != len(data) - 8:
        raise Corrupt(f"seam of {len(data)} bytes, its arrays end at {at}")
    if xxhash.xxh3_64_intdigest(data[:-8]) != int.from_bytes(data[-8:], "little"):
        raise Corrupt("seam whose checksum does not match")
