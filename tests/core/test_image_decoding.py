"""JPEG of every kind has the pixels that Pillow, and with it libjpeg-turbo, reads; kinds that no browser shows are refused by name."""

import io
import struct

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from map3d import _core

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

SIZE = (45, 35)
"""No multiple of a block, so that the edges count."""


def picture() -> Image.Image:
    """A smooth picture with edges in colour."""
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    red, green, blue = (x * 5) % 256, (y * 7) % 256, np.where((x // 9 + y // 7) % 2, 220, 30)
    return Image.fromarray(np.dstack([red, green, blue]).astype(np.uint8))


def jpeg(image: Image.Image, **options: object) -> bytes:
    out = io.BytesIO()
    image.save(out, "JPEG", quality=90, **options)
    return out.getvalue()


def inks() -> Image.Image:
    """Returns the picture in inks, of which black takes as much as all three have in common."""
    rgb = np.asarray(picture()).astype(float)
    light = np.maximum(rgb.max(axis=2), 1.0)
    bands = [255.0 - 255.0 * rgb[:, :, k] / light for k in range(3)] + [255.0 - light]
    return Image.merge("CMYK", [Image.fromarray(np.rint(band).astype(np.uint8)) for band in bands])


def segments(data: bytes, marker: int) -> tuple[bytes, bytes, bytes]:
    """Returns what is before the first segment with a marker, the segment with the marker, and what follows."""
    at = 2
    while data[at + 1] != marker:
        at += 2 + int(struct.unpack(">H", data[at + 2 : at + 4])[0])
    end = at + 2 + int(struct.unpack(">H", data[at + 2 : at + 4])[0])
    return data[:at], data[at:end], data[end:]


def without(data: bytes, marker: int) -> bytes:
    before, _, after = segments(data, marker)
    return before + after


def with_transform(data: bytes, transform: int) -> bytes:
    """Replaces the colour transform of the Adobe marker."""
    before, adobe, after = segments(data, 0xEE)
    return before + adobe[:-1] + bytes([transform]) + after


def with_adobe(data: bytes, transform: int) -> bytes:
    return data[:2] + b"\xff\xee\x00\x0eAdobe\x00\x64\x00\x00\x00\x00" + bytes([transform]) + data[2:]


KINDS = {
    "grey": jpeg(picture().convert("L")),
    "grey progressive": jpeg(picture().convert("L"), progressive=True),
    "4:4:4": jpeg(picture(), subsampling=0),
    "4:2:2": jpeg(picture(), subsampling=1),
    "4:2:0": jpeg(picture(), subsampling=2),
    "progressive": jpeg(picture(), subsampling=2, progressive=True),
    "optimized": jpeg(picture(), subsampling=1, optimize=True),
    "restart markers": jpeg(picture(), subsampling=2, restart_marker_blocks=1),
    "restart markers, progressive": jpeg(picture(), subsampling=0, restart_marker_rows=1, progressive=True),
    "RGB": jpeg(picture(), keep_rgb=True),
    "RGB progressive": jpeg(picture(), keep_rgb=True, progressive=True),
    "RGB by the names of its components": without(jpeg(picture(), keep_rgb=True), 0xEE),
    "YCbCr, although an Adobe marker beside JFIF says RGB": with_adobe(jpeg(picture(), subsampling=0), 0),
    "YCbCr with an Adobe marker and without JFIF": with_adobe(without(jpeg(picture(), subsampling=0), 0xE0), 1),
    "CMYK": jpeg(inks()),
    "CMYK progressive": jpeg(inks(), progressive=True),
    "CMYK with restart markers": jpeg(inks(), restart_marker_blocks=2),
    "CMYK without an Adobe marker": without(jpeg(inks()), 0xEE),
    "YCCK": with_transform(jpeg(inks()), 2),
    "YCCK progressive": with_transform(jpeg(inks(), progressive=True), 2),
    "with bytes behind its end": jpeg(picture(), subsampling=0) + bytes(100),
}


def decoded(data: bytes) -> NDArray[np.int16]:
    return _core.decode_image(data).astype(np.int16)


@pytest.mark.parametrize("kind", KINDS)
def test_pixels_are_those_of_libjpeg_turbo(kind: str) -> None:
    with Image.open(io.BytesIO(KINDS[kind])) as image:
        expected = np.asarray(image.convert("RGB")).astype(np.int16)
    found = decoded(KINDS[kind])
    assert (found[:, :, 3] == 255).all()
    # The two round products of inks differently.
    assert np.abs(found[:, :, :3] - expected).max() <= (1 if kind.startswith(("CMYK", "YCCK")) else 0)


@pytest.mark.parametrize("kind", ["grey", "4:4:4", "progressive", "RGB", "CMYK"])
def test_a_file_that_lacks_only_its_end_mark_is_read(kind: str) -> None:
    assert (decoded(KINDS[kind][:-2]) == decoded(KINDS[kind])).all()


def test_inks_have_the_colours_of_the_picture() -> None:
    expected = np.asarray(picture()).astype(np.int16)
    assert np.abs(decoded(jpeg(inks(), subsampling=0))[:, :, :3] - expected).mean() < 8


def frame_of(data: bytes, *, marker: int = 0xC0, precision: int = 8) -> bytes:
    """Replaces the marker and the precision of the frame."""
    before, frame, after = segments(data, 0xC0)
    return before + bytes([0xFF, marker]) + frame[2:4] + bytes([precision]) + frame[5:] + after


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (frame_of(KINDS["4:4:4"], precision=12), "12-bit JPEG"),
        (frame_of(KINDS["4:4:4"], marker=0xC1, precision=12), "12-bit JPEG"),
        (frame_of(KINDS["grey"], marker=0xC3), "lossless JPEG"),
        (frame_of(KINDS["grey"], marker=0xCB), "lossless JPEG"),
        (frame_of(KINDS["grey"], marker=0xC5), "hierarchical JPEG"),
    ],
)
def test_other_kinds_are_refused_by_name(data: bytes, name: str) -> None:
    with pytest.raises(_core.FormatError, match=name):
        _core.decode_image(data)


@pytest.mark.parametrize("kind", ["grey", "4:2:0", "progressive", "RGB", "CMYK", "YCCK"])
@pytest.mark.parametrize("share", [0.5, 0.9])
def test_a_cut_file_is_refused(kind: str, share: float) -> None:
    with pytest.raises(_core.FormatError, match=r"cut or damaged"):
        _core.decode_image(KINDS[kind][: int(len(KINDS[kind]) * share)])
