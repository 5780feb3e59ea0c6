"""Decoding of stored tiles and seams."""

import io

import numpy as np
import pytest
import xxhash
from PIL import Image

from map3d.errors import Corrupt
from map3d.types import Layer, Sun
from map3d.verify.decode import check_seam, decode_tile, ids_of

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
def test_layers_of_light_decode_in_their_own_mode_only(kind: str) -> None:
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


def test_ids_are_little_endian_and_nothing_is_left_out() -> None:
    pixels = np.zeros((2, 2, 4), np.uint8)
    pixels[0, 0] = (4, 3, 2, 1)
    pixels[0, 1] = (7, 0, 0, 0)
    assert ids_of(pixels).tolist() == [7, 0x01020304]


def seam(size: int = 256, arrays: int = 0b1101, version: int = 2) -> bytes:
    body = b"M3DG" + b"".join(value.to_bytes(4, "little") for value in (version, size, size, arrays))
    body += b"".join((4 + bit).to_bytes(4, "little") + b"zstd" + b"." * bit for bit in range(32) if arrays >> bit & 1)
    return body + xxhash.xxh3_64_intdigest(body).to_bytes(8, "little")


def test_a_whole_seam_passes_and_any_change_does_not() -> None:
    good = seam()
    check_seam(good, 256, LAYERS)
    for at in range(0, len(good), 3):
        changed = bytearray(good)
        changed[at] ^= 1
        with pytest.raises(Corrupt):
            check_seam(bytes(changed), 256, LAYERS)
    for broken in (b"", good[:20], good[:-1], good + b"x", seam(512), seam(version=1), seam(version=3)):
        with pytest.raises(Corrupt):
            check_seam(broken, 256, LAYERS)


@pytest.mark.parametrize(
    ("kinds", "arrays"),
    [
        (("color", "normal", "id", "depth"), 0b000001111),
        (("normal",), 0b000001110),
        (("sun",), 0b000011100),
        (("sun16", "ao"), 0b001101100),
        (("depth2",), 0b010001100),
        (("picture", "color"), 0b100001101),
    ],
)
def test_a_seam_has_the_arrays_of_its_layers_and_always_id_and_depth(kinds: tuple[str, ...], arrays: int) -> None:
    layers = [LIGHT[kind][0] if kind in LIGHT else Layer(f"my-{kind}", kind, "png") for kind in kinds]
    check_seam(seam(arrays=arrays), 256, layers)
    for bit in range(10):
        with pytest.raises(Corrupt, match="seam with arrays"):
            check_seam(seam(arrays=arrays ^ 1 << bit), 256, layers)
