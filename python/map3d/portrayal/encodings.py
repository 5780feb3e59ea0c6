"""Encodes image layers as images (OGC 15-001r4 §10.2.1, docs/portrayal-service.md)."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from map3d import _core
from map3d.portrayal.image_formats import ImageFormat
from map3d.portrayal.scalars import Color

PNG_LEVEL: Final = 1
BEST_JPEG: Final = 95
NO_MILLIMETRES: Final = 0xFFFFFF
MAX_24_BIT: Final = 0xFFFFFF
RGB: Final = (0, 1, 2)
BGR: Final = (2, 1, 0)
RGBA: Final = (0, 1, 2, 3)
"""Channels in the order in which an image has them."""

Pixels = NDArray[np.uint8]
Arrays = Mapping[str, NDArray[Any]]
"""What a view consists of: color (h, w, 4) uint8 with straight alpha, normal (h, w, 3) uint8, x in the first channel, id (h, w) uint32, depth (h, w)
float32 with NaN for nothing, ao and sun (h, w) uint8."""


class CannotEncode(Exception):
    """The values of a view do not fit into the requested format."""


@dataclass(frozen=True)
class Background:
    """The colour of pixels without a surface, and whether they are transparent where the format can be."""

    color: Color = (255, 255, 255)
    transparent: bool = False


def encode_layer(name: str, image_format: ImageFormat, quality: int, background: Background, arrays: Arrays) -> bytes:
    """Returns the image of an image layer. `quality`: 0 to 100, for lossy formats. Raises CannotEncode."""
    match name:
        case "COLOR":
            return _encode_color(arrays["color"], background, image_format, quality)
        case "DEPTH":
            return _encode_words("depth", depth_words(arrays["depth"], image_format), image_format)
        case "OBJECTID":
            return _encode_words("id", arrays["id"], id_format(arrays["id"], image_format))
        case "NORMAL":
            return _encode_normal(arrays["normal"], image_format, quality)
        case "MASK":
            return _encode_mask(arrays["id"], image_format, quality)
        case "AO" | "SUN":
            return _encode_shades(name, arrays[name.lower()], image_format, quality)
        case _:
            raise AssertionError(name)


def opaque_color(color: Pixels, background: Background) -> Pixels:
    """Returns (h, w, 4) with the background behind what is not opaque."""
    alpha = color[..., 3]
    if alpha.min(initial=255) == 255:
        return color
    # Pixels as words, which NumPy chooses faster than rows of bytes.
    words = np.ascontiguousarray(color).view(np.uint32)[..., 0]
    behind = np.array((*background.color, 255), np.uint8).view(np.uint32)[0]
    flat = np.where(alpha == 0, behind, words)[..., None].view(np.uint8)
    mixed = (alpha > 0) & (alpha < 255)
    parts = color[mixed].astype(np.uint32)
    share = parts[:, 3:]
    parts[:, :3] = (parts[:, :3] * share + np.array(background.color, np.uint32) * (255 - share) + 127) // 255
    parts[:, 3] = 255
    flat[mixed] = parts
    return flat


def depth_words(depth: NDArray[np.float32], image_format: ImageFormat) -> NDArray[np.uint32]:
    """Returns the bits of each float; 24 bits are its upper three bytes. No surface: +∞, in millimetres 0xFFFFFF."""
    nothing = np.isnan(depth)
    if image_format.encoding == "millimetres":
        with np.errstate(invalid="ignore"):
            rounded = np.clip(np.rint(depth.astype(np.float64) * 1000.0), 0, NO_MILLIMETRES - 1)
        return np.asarray(np.where(nothing, float(NO_MILLIMETRES), rounded), np.uint32)
    floats = np.array(depth, np.float32, order="C")
    floats[nothing] = np.inf
    words = floats.view(np.uint32)
    return words >> np.uint32(8) if image_format.mode == "24bit" else words


def id_format(ids: NDArray[np.uint32], image_format: ImageFormat) -> ImageFormat:
    """Returns the format with its mode: without one, 24 bits where all ids of the view fit. Raises CannotEncode."""
    greatest = int(ids.max(initial=0))
    if image_format.mode == "24bit" and greatest > MAX_24_BIT:
        raise CannotEncode(f"object id {greatest} does not fit into 24 bits; request image/png;mode=32bit")
    mode = image_format.mode or ("24bit" if greatest <= MAX_24_BIT else "32bit")
    return replace(image_format, mode=mode)


def _encode_color(color: Pixels, background: Background, image_format: ImageFormat, quality: int) -> bytes:
    """Encodes an alpha channel where the format has one and the request needs it."""
    has_alpha = image_format.image_type != "jpeg" and image_format.mode != "24bit"
    keeps_alpha = background.transparent and has_alpha
    pixels = color if keeps_alpha else opaque_color(color, background)
    order = RGBA if keeps_alpha or image_format.mode == "32bit" else RGB
    if image_format.image_type == "png":
        return _core.encode_png("color", pixels, order)
    return _encode_lossy(pixels[..., : len(order)], image_format, quality)


def _encode_words(kind: Literal["depth", "id"], words: NDArray[np.uint32], image_format: ImageFormat) -> bytes:
    """Encodes 24 or 32 bit words, the most significant byte first: in the order B, G, R or A, B, G, R; with an explicit encoding R, G, B or
    R, G, B, A."""
    little_endian = np.ascontiguousarray(words.astype("<u4", copy=False)).view(np.uint8).reshape(*words.shape, 4)
    significant_last = RGB if image_format.mode == "24bit" else RGBA
    return _core.encode_png(kind, little_endian, significant_last[::-1] if image_format.encoding else significant_last)


def _encode_normal(normal: Pixels, image_format: ImageFormat, quality: int) -> bytes:
    """Encodes x in B, y in G, z in R; x in R with `encoding=rgb`. 32 bits have an alpha channel: 0 without a surface."""
    order = RGB if image_format.encoding == "rgb" else BGR
    if image_format.image_type != "png":
        return _encode_lossy(normal[..., order], image_format, quality)
    if image_format.mode != "32bit":
        return _core.encode_png("normal", normal, order)
    alpha = np.where(normal.any(axis=-1), np.uint8(255), np.uint8(0))
    return _core.encode_png("normal", np.concatenate([normal, alpha[..., None]], axis=-1), (*order, 3))


def _encode_mask(ids: NDArray[np.uint32], image_format: ImageFormat, quality: int) -> bytes:
    """Encodes white where nothing is, black where an object is."""
    nothing = ids == 0
    if image_format.image_type == "png":
        return _core.encode_bits(nothing)
    return _encode_lossy(np.where(nothing, np.uint8(255), np.uint8(0)), image_format, quality)


def _encode_shades(name: str, shades: Pixels, image_format: ImageFormat, quality: int) -> bytes:
    if image_format.image_type == "png":
        return _core.encode_png("ao" if name == "AO" else "sun", shades[..., None], (0,))
    return _encode_lossy(shades, image_format, quality)


def encode_image(image: Image.Image, image_format: ImageFormat, quality: int) -> bytes:
    data = io.BytesIO()
    match image_format.image_type:
        case "jpeg":
            image.save(data, "JPEG", quality=min(max(quality, 1), BEST_JPEG), subsampling=0 if quality >= 90 else 2)
        case "webp":
            image.save(data, "WEBP", quality=quality, method=2)
        case _:
            image.save(data, "PNG", compress_level=PNG_LEVEL)
    return data.getvalue()


def _encode_lossy(pixels: Pixels, image_format: ImageFormat, quality: int) -> bytes:
    """Encodes (h, w), (h, w, 3) or (h, w, 4) as JPEG or WebP."""
    return encode_image(Image.fromarray(np.ascontiguousarray(pixels)), image_format, quality)
