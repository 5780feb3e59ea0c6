"""Decoding of stored tiles: images and data tiles."""

import io
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from map3d import _core
from map3d.errors import Corrupt
from map3d.tiles.decode_tile import as_layer, decode_tile, find_layer, kinds_of, layer_names, layer_with, paste, with_alpha
from map3d.types import DATA_TILE_KINDS, Layer, LayerKind, Sun

COLOR, ID, DATA = Layer("color", "color", "webp", 80), Layer("id", "id", "png"), Layer("data", "data", "m3d")


def image(mode: str, size: int, format: str) -> bytes:
    out = io.BytesIO()
    Image.new(mode, (size, size)).save(out, format)
    return out.getvalue()


def surfaces(side: int = 256) -> dict[str, NDArray[Any]]:
    """Returns normal int16, id and depth of a G-buffer: three faces and a corner without content."""
    y, x = np.mgrid[0:side, 0:side]
    face = (x // 50 + y // 70) % 3
    empty = x + y < side // 4
    normal = np.array([(0, 0, 32767), (23170, 0, 23170), (-23170, -1, 23170)], np.int16)[face]
    normal[empty] = 0
    ids = np.where(empty, 0, face + 70_000)
    depth = np.where(empty, 0xFFFFFFFF, 900_000 + 70 * x + 143 * y)
    return {"normal": normal, "id": ids.astype(np.uint32), "depth": depth.astype(np.uint32)}


def data_tile(side: int = 256, *, small: bool = False) -> bytes:
    arrays = surfaces(side)
    return _core.encode_data_tile(arrays["normal"], arrays["id"], arrays["depth"], small)


def test_images_decode_to_their_size() -> None:
    assert decode_tile(COLOR, image("RGBA", 256, "WEBP"), 256)["color"].shape == (256, 256, 4)
    ids = decode_tile(ID, image("RGBA", 256, "PNG"), 256)["id"]
    assert (ids.shape, ids.dtype) == ((256, 256), np.uint32)


SUN = Sun(None, 180.0, 45.0, (0.0, -(0.5**0.5), 0.5**0.5))
LIGHT: dict[LayerKind, tuple[Layer, str, tuple[int, ...], str]] = {
    "sun": (Layer("sun", "sun", "png", suns=(SUN,)), "L", (), "uint8"),
    "sun16": (Layer("sun16", "sun16", "png", suns=(SUN,)), "LA", (), "uint16"),
    "ao": (Layer("ao", "ao", "png", radius_m=20.0), "L", (), "uint8"),
    "depth2": (Layer("depth2", "depth2", "png"), "RGBA", (), "uint32"),
    "picture": (Layer("picture", "picture", "png", suns=(SUN,), radius_m=20.0), "RGBA", (4,), "uint8"),
}


@pytest.mark.parametrize("kind", LIGHT)
def test_light_layers_decode_in_their_own_mode_only(kind: LayerKind) -> None:
    layer, mode, channels, dtype = LIGHT[kind]
    pixels = decode_tile(layer, image(mode, 256, "PNG"), 256)[kind]
    assert (pixels.shape, pixels.dtype) == ((256, 256, *channels), dtype)
    for other in {"L", "LA", "RGBA"} - {mode}:
        with pytest.raises(Corrupt, match=f"{other} of 256 × 256 px, expected"):
            decode_tile(layer, image(other, 256, "PNG"), 256)


def huge_png() -> bytes:
    """Returns a PNG whose header says 100,000 × 100,000 pixels."""
    header = b"IHDR" + struct.pack(">IIBBBBB", 100_000, 100_000, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))


@pytest.mark.parametrize(
    ("layer", "data"),
    [
        (COLOR, b""),
        (COLOR, b"RIFF\0\0\0\0WEBP"),
        (COLOR, image("RGBA", 256, "PNG")),
        (ID, image("RGBA", 128, "PNG")),
        (ID, image("RGB", 256, "PNG")),
        (ID, image("RGBA", 256, "PNG")[:-40]),
        (ID, huge_png()),
        (ID, data_tile()),
        (DATA, b""),
        (DATA, b"M3D\1"),
        (DATA, data_tile()[:-1]),
        (DATA, data_tile() + b"\0"),
        (DATA, b"M3D\2" + data_tile()[4:]),
        (DATA, image("RGBA", 256, "PNG")),
    ],
)  # fmt: skip
def test_other_bytes_are_corrupt(layer: Layer, data: bytes) -> None:
    with pytest.raises(Corrupt):
        decode_tile(layer, data, 256)


def test_a_data_tile_of_another_size_is_corrupt() -> None:
    with pytest.raises(Corrupt, match="data tile of 128 × 128 px, expected 256 × 256"):
        decode_tile(DATA, data_tile(128), 256)


def test_a_flipped_bit_of_a_data_tile_changes_no_pixel_unnoticed() -> None:
    """The checksum of the zlib stream covers the body, the rules of the format the header; a few bits of the stream mean nothing."""
    whole = data_tile()
    expected, refused = decode_tile(DATA, whole, 256), 0
    for at in np.random.default_rng(7).integers(0, len(whole), 300):
        broken = bytearray(whole)
        broken[at] ^= 1 << (at % 8)
        try:
            found = decode_tile(DATA, bytes(broken), 256)
        except Corrupt:
            refused += 1
        else:
            assert all(np.array_equal(found[kind], expected[kind]) for kind in DATA_TILE_KINDS)
    assert refused > 280


@pytest.mark.parametrize("small", [False, True])
@pytest.mark.parametrize("kind", DATA_TILE_KINDS)
def test_layers_made_of_a_data_tile_have_the_bytes_of_the_png_layers(kind: str, small: bool) -> None:
    found = find_layer((COLOR, Layer("data", "data", "m3d", small=small)), kind)
    assert found is not None
    asked, stored = found
    assert (asked.name, asked.kind, asked.media_type, stored.name) == (kind, kind, "image/png", "data")
    png = _core.encode_layer(asked.kind, "png", surfaces()[kind], small=small)
    assert as_layer(asked, stored, data_tile(small=small), 256, "here") == png
    assert np.array_equal(decode_tile(asked, png, 256)[kind], decode_tile(stored, data_tile(), 256)[kind])


def test_stored_layers_are_sent_as_they_are() -> None:
    found = find_layer((COLOR, DATA), "data")
    assert found == (DATA, DATA)
    assert as_layer(*found, b"bytes", 256, "here") == b"bytes"


def test_a_damaged_data_tile_is_named() -> None:
    found = find_layer((COLOR, DATA), "id")
    assert found is not None
    with pytest.raises(Corrupt, match=r"^town/data/0/0/0: data tile: .*; run: map3d verify$"):
        as_layer(*found, b"M3D\1", 256, "town/data/0/0/0")


def test_a_stored_layer_precedes_the_one_made_of_a_data_tile() -> None:
    assert find_layer((DATA, ID), "id") == (ID, ID)
    assert layer_names((COLOR, DATA, ID)) == ["color", "data", "id", "normal", "depth"]
    assert layer_names((COLOR, ID)) == ["color", "id"]
    for layers, name in (((COLOR, ID), "depth"), ((COLOR, DATA), "depth2"), ((), "id")):
        assert find_layer(layers, name) is None


def test_kinds_are_found_in_the_first_layer_that_holds_them() -> None:
    assert [kinds_of(layer) for layer in (COLOR, DATA)] == [("color",), ("normal", "id", "depth")]
    assert layer_with((COLOR, DATA, ID), "id") is DATA
    assert layer_with((ID, DATA), "id") is ID
    assert layer_with((COLOR, ID), "normal") is None


def test_colours_without_alpha_are_opaque() -> None:
    rgb = np.full((2, 3, 3), 7, np.uint8)
    assert np.array_equal(with_alpha(rgb), np.full((2, 3, 4), (7, 7, 7, 255)))
    rgba = with_alpha(rgb)
    assert with_alpha(rgba) is rgba


@pytest.mark.parametrize(("x", "y"), [(0, 0), (-1, 2), (3, -2), (-3, -3), (4, 4), (5, 5), (-9, 0)])
def test_paste_copies_what_lies_inside(x: int, y: int) -> None:
    into, tile = np.zeros((5, 5), np.uint8), np.arange(1, 10, dtype=np.uint8).reshape(3, 3)
    expected = into.copy()
    for row in range(3):
        for column in range(3):
            if 0 <= y + row < 5 and 0 <= x + column < 5:
                expected[y + row, x + column] = tile[row, column]
    paste(into, tile, x, y)
    assert np.array_equal(into, expected)
