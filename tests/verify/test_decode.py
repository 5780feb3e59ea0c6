"""Decoding of stored tiles and seams."""

import io

import numpy as np
import pytest
from PIL import Image

from map3d.errors import Corrupt
from map3d.types import Layer, Sun
from map3d.verify.decode import decode_tile, ids_of

LAYERS = (Layer("color", "color", "webp", 80), Layer("id", "id", "png"))


def image(mode: str, size: int, format: str) -> bytes:
    out = io.BytesIO()
    Image.new(mode, (size, size)).save(out, format)
    return out.getvalue()


def test_tiles_decode_to_their_size() -> None:
    assert decode_tile(LAYERS[0], image("RGBA", 256, "WEBP"), 256).shape[:2] == (256, 256)
    assert decode_tile(LAYERS[1], image("RGBA", 256, "PNG"), 256).shape == (256, 256, 4)


SUN = Sun(None, 180.0, 45.0, (0.0, -(0.5**0.5), 0.5**0.5))
LIGHT = {
    "sun": (Layer("sun", "sun", "png", suns=(SUN,)), "L", 1),
    "sun16": (Layer("sun16", "sun16", "png", suns=(SUN,)), "LA", 2),
    "ao": (Layer("ao", "ao", "png", radius_m=20.0), "L", 1),
    "depth2": (Layer("depth2", "depth2", "png"), "RGBA", 4),
    "picture": (Layer("picture", "picture", "png", suns=(SUN,), radius_m=20.0), "RGBA", 4),
}


@pytest.mark.parametrize("kind", LIGHT)
def test_light_layers_decode_in_their_own_mode_only(kind: str) -> None:
    layer, mode, channels = LIGHT[kind]
    assert decode_tile(layer, image(mode, 256, "PNG"), 256).shape == (256, 256, channels)
    for other in {"L", "LA", "RGBA"} - {mode}:
        with pytest.raises(Corrupt, match=f"{other} of 256 × 256 px, expected"):
            decode_tile(layer, image(other, 256, "PNG"), 256)


@pytest.mark.parametrize(
    ("layer", "data"),
    [
        (LAYERS[0], b""),
        (LAYERS[0], b"RIFF\0\0\0\0WEBP"),
        (LAYERS[0], image("RGBA", 256, "PNG")),
        (LAYERS[1], image("RGBA", 128, "PNG")),
        (LAYERS[1], image("RGB", 256, "PNG")),
        (LAYERS[1], image("RGBA", 256, "PNG")[:-40]),
    ],
)
def test_other_bytes_are_corrupt(layer: Layer, data: bytes) -> None:
    with pytest.raises(Corrupt):
        decode_tile(layer, data, 256)


def test_ids_are_little_endian_and_id_zero_is_omitted() -> None:
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0] = (4, 3, 2, 1)
    pixels[0, 1] = (7, 0, 0, 0)
    assert ids_of(pixels).tolist() == [7, 0x01020304]
