"""Image formats of tiles in tile services: the stored one, and PNG for clients that cannot read it; empty tiles as images."""

import io
from functools import lru_cache
from typing import Final

from PIL import Image

from map3d.errors import BadRequest, Corrupt
from map3d.types import MEDIA_TYPES, Layer

SUFFIXES: Final = {"image/webp": "webp", "image/png": "png", "image/jpeg": "jpg"}
PNG: Final = "image/png"
EMPTY_COLOR: Final = (255, 255, 255)
"""Colour of an empty tile in JPEG, which has no transparency: the default background of WMS."""
_BY_SUFFIX: Final = {**{suffix: media_type for media_type, suffix in SUFFIXES.items()}, "jpeg": "image/jpeg"}
_PILLOW_FORMATS: Final = {media_type: name for name, media_type in MEDIA_TYPES.items()}


def suffix_of(media_type: str) -> str:
    return SUFFIXES[media_type]


def media_types_of(layer: Layer) -> tuple[str, ...]:
    """Returns the media types in which a layer's tiles are available: the stored one first."""
    return tuple(dict.fromkeys((layer.media_type, PNG)))


def parse_suffix(suffix: str) -> str | None:
    """Returns the media type of a file name's suffix or a value of `f`; None for an unknown one."""
    return _BY_SUFFIX.get(suffix)


def check_media_type(layer: Layer, media_type: str) -> str:
    """Raises BadRequest for a media type in which the layer's tiles are not available."""
    if media_type not in media_types_of(layer):
        raise BadRequest(f"layer {layer.name!r} has no tiles as {media_type!r:.70}; expected {' or '.join(media_types_of(layer))}")
    return media_type


def convert_tile(data: bytes, media_type: str) -> bytes:
    """Returns an encoded tile in another format, with the same pixels. Raises Corrupt for bytes that are not an image."""
    try:
        with Image.open(io.BytesIO(data)) as tile:
            tile.load()
            return _encode(tile, media_type)
    except (OSError, ValueError) as error:
        raise Corrupt(f"a tile is not an image: {error}; run: map3d verify") from error


@lru_cache(maxsize=8)
def empty_tile(tile_px: int, media_type: str) -> bytes:
    """Returns a transparent tile, a white one as JPEG. Clients such as Leaflet report an error for an answer without an image."""
    with Image.new("RGBA", (tile_px, tile_px)) as tile:
        return _encode(tile, media_type)


def _encode(tile: Image.Image, media_type: str) -> bytes:
    out = io.BytesIO()
    if media_type == "image/jpeg" and tile.mode == "RGBA":
        with Image.new("RGB", tile.size, EMPTY_COLOR) as opaque:
            opaque.paste(tile, mask=tile)
            opaque.save(out, "JPEG", quality=90)
    elif media_type == "image/webp":
        tile.save(out, "WEBP", lossless=True)
    else:
        tile.save(out, _PILLOW_FORMATS[media_type])
    return out.getvalue()
