"""PNGs of channels in any order and of bits, decoded by Pillow."""

import io

import numpy as np
import pytest
from PIL import Image

from map3d import _core

RNG = np.random.default_rng(8)


def decoded(data: bytes) -> Image.Image:
    image = Image.open(io.BytesIO(data))
    image.load()
    return image


@pytest.mark.parametrize("kind", ["color", "normal", "id", "depth", "sun", "ao"])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (2, 1, 0), (0, 1, 2), (1, 3), (2,)])
def test_channels_are_encoded_in_the_order_given(kind: str, order: tuple[int, ...]) -> None:
    pixels = RNG.integers(0, 256, (13, 29, 4), np.uint8)
    image = decoded(_core.encode_png(kind, pixels, order))
    assert image.mode == {1: "L", 2: "LA", 3: "RGB", 4: "RGBA"}[len(order)]
    assert np.array_equal(np.asarray(image).reshape(13, 29, -1), pixels[..., list(order)])


def test_arrays_of_any_layout_are_encoded() -> None:
    pixels = RNG.integers(0, 256, (40, 30, 3), np.uint8)
    for array in (pixels[::-1], pixels[:, ::2], pixels[..., ::-1], np.asfortranarray(pixels), pixels.transpose(1, 0, 2)):
        assert np.array_equal(np.asarray(decoded(_core.encode_png("color", array, (0, 1, 2)))), array)


@pytest.mark.parametrize("width", [1, 7, 8, 9, 64, 65])
def test_bits_fill_bytes_from_the_left(width: int) -> None:
    bits = RNG.integers(0, 2, (5, width)).astype(bool)
    image = decoded(_core.encode_bits(bits))
    assert image.mode == "1"
    assert np.array_equal(np.asarray(image), bits)
    assert np.array_equal(np.asarray(decoded(_core.encode_bits(bits[::-1, ::-1]))), bits[::-1, ::-1])


def test_misuse_is_refused() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    for array, order in ((pixels, (3,)), (pixels, ()), (pixels, (0, 1, 2, 0, 1)), (pixels[:0], (0,)), (pixels[:, :0], (0,)), (pixels[..., :0], (0,))):
        with pytest.raises(_core.InvalidArgument):
            _core.encode_png("color", array, order)
    with pytest.raises(_core.InvalidArgument):
        _core.encode_bits(np.zeros((0, 3), bool))
