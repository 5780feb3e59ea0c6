"""Images hold what the standard says, byte by byte; decoded here by independent code."""

import io
import struct

import numpy as np
import pytest
from PIL import Image

from map3d.portrayal.encodings import Background, CannotEncode, encode_layer
from map3d.portrayal.image_formats import IMAGE_LAYERS, parse_format

DEPTHS = np.array([[0.0, 1.5, 123.456, 65000.25, np.nan]], np.float32)
IDS = np.array([[0, 1, 258, 0x00ABCDEF, 0xFFFFFF]], np.uint32)


def encode(name: str, text: str, background: Background | None = None, quality: int = 100, **arrays: np.ndarray) -> Image.Image:
    layer = IMAGE_LAYERS[name]
    data = encode_layer(name, parse_format(text, layer), quality, background or Background(), arrays)
    image = Image.open(io.BytesIO(data))
    image.load()
    return image


def pixels(image: Image.Image) -> list[tuple[int, ...]]:
    flat = np.asarray(image).reshape(-1, len(image.getbands()))
    return [tuple(row) for row in flat.tolist()]


def test_ids_of_32_bits_are_alpha_blue_green_red() -> None:
    found = [a << 24 | b << 16 | g << 8 | r for r, g, b, a in pixels(encode("OBJECTID", "image/png;mode=32bit", id=IDS | 0x7F000000))]
    assert found == (IDS | 0x7F000000)[0].tolist()


def test_ids_of_24_bits_are_blue_green_red() -> None:
    assert [b << 16 | g << 8 | r for r, g, b in pixels(encode("OBJECTID", "image/png;mode=24bit", id=IDS))] == IDS[0].tolist()
    assert [r << 16 | g << 8 | b for r, g, b in pixels(encode("OBJECTID", "image/png;mode=24bit;encoding=rgb", id=IDS))] == IDS[0].tolist()


def test_ids_choose_the_bit_depth_without_a_mode() -> None:
    assert encode("OBJECTID", "image/png", id=IDS).mode == "RGB"
    assert encode("OBJECTID", "image/png", id=IDS + np.uint32(1)).mode == "RGBA"


def test_ids_beyond_24_bits_are_refused() -> None:
    with pytest.raises(CannotEncode, match="16777216 does not fit into 24 bits"):
        encode("OBJECTID", "image/png;mode=24bit", id=IDS + np.uint32(1))


def test_depths_of_32_bits_are_the_bytes_of_floats() -> None:
    found = [struct.unpack(">f", bytes((a, b, g, r)))[0] for r, g, b, a in pixels(encode("DEPTH", "image/png;mode=32bit", depth=DEPTHS))]
    assert found == [*DEPTHS[0, :4].tolist(), float("inf")]
    assert pixels(encode("DEPTH", "image/png", depth=DEPTHS)) == pixels(encode("DEPTH", "image/png;mode=32bit", depth=DEPTHS))
    explicit = pixels(encode("DEPTH", "image/png;mode=32bit;encoding=rgba", depth=DEPTHS))
    assert [struct.unpack(">f", bytes(rgba))[0] for rgba in explicit] == found


def test_depths_of_24_bits_are_the_upper_bytes_of_floats() -> None:
    found = [struct.unpack(">f", bytes((b, g, r, 0)))[0] for r, g, b in pixels(encode("DEPTH", "image/png;mode=24bit", depth=DEPTHS))]
    assert np.allclose(found[:4], DEPTHS[0, :4], rtol=2**-15)
    assert found[4] == float("inf")


def test_depths_in_millimetres() -> None:
    found = [r << 16 | g << 8 | b for r, g, b in pixels(encode("DEPTH", "image/png;mode=24bit;encoding=millimetres", depth=DEPTHS))]
    assert found == [0, 1500, 123456, 0xFFFFFE, 0xFFFFFF]


def test_normals_are_blue_green_red() -> None:
    normal = np.array([[[10, 20, 30], [0, 0, 0]]], np.uint8)
    assert pixels(encode("NORMAL", "image/png", normal=normal)) == [(30, 20, 10), (0, 0, 0)]
    assert pixels(encode("NORMAL", "image/png;mode=32bit", normal=normal)) == [(30, 20, 10, 255), (0, 0, 0, 0)]
    assert pixels(encode("NORMAL", "image/png;mode=24bit;encoding=rgb", normal=normal)) == [(10, 20, 30), (0, 0, 0)]


def test_mask_is_black_where_an_object_is() -> None:
    for text, mode in (("image/png", "1"), ("image/png;mode=1bit", "1")):
        image = encode("MASK", text, id=IDS)
        assert (image.mode, np.asarray(image).tolist()) == (mode, [[True, False, False, False, False]])
    assert np.asarray(encode("MASK", "image/jpeg", id=np.repeat(np.repeat(IDS, 8, 0), 8, 1)))[4, [4, 12]].tolist() == [255, 0]


COLOR = np.array([[[100, 50, 0, 255], [100, 50, 0, 51], [0, 0, 0, 0]]], np.uint8)


def test_colors_are_laid_over_the_background() -> None:
    assert pixels(encode("COLOR", "image/png", Background((0, 100, 200)), color=COLOR)) == [(100, 50, 0), (20, 90, 160), (0, 100, 200)]
    assert pixels(encode("COLOR", "image/png;mode=32bit", Background((0, 100, 200)), color=COLOR))[2] == (0, 100, 200, 255)


def test_transparent_background_needs_an_alpha_channel() -> None:
    clear = Background(transparent=True)
    for text in ("image/png", "image/png;mode=32bit"):
        assert pixels(encode("COLOR", text, clear, color=COLOR)) == [tuple(pixel) for pixel in COLOR[0].tolist()]
    assert pixels(encode("COLOR", "image/png;mode=24bit", clear, color=COLOR))[2] == (255, 255, 255)
    assert encode("COLOR", "image/jpeg", clear, color=COLOR).mode == "RGB"
    assert encode("COLOR", "image/webp", clear, color=COLOR).mode == "RGBA"


def test_quality_changes_lossy_formats_only() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (64, 64, 4), np.uint8)
    layer = IMAGE_LAYERS["COLOR"]
    sizes = {
        text: [len(encode_layer("COLOR", parse_format(text, layer), quality, Background(), {"color": noise})) for quality in (0, 50, 100)]
        for text in ("image/jpeg", "image/webp", "image/png")
    }
    assert sizes["image/jpeg"] == sorted(set(sizes["image/jpeg"]))
    assert sizes["image/webp"] == sorted(set(sizes["image/webp"]))
    assert len(set(sizes["image/png"])) == 1
