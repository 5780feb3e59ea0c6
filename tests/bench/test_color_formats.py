"""The SSIM of the benchmark of colour formats."""

import io

import numpy as np
import pytest
from bench.color_formats import compare, luma, ssim
from PIL import Image


def png(pixels):
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG")
    return out.getvalue()


def test_ssim_is_that_of_its_definition_window_by_window():
    random = np.random.default_rng(1)
    a = random.integers(0, 256, (20, 24, 3), dtype=np.uint8)
    b = np.clip(a + random.integers(-20, 20, a.shape), 0, 255).astype(np.uint8)
    first, second, found = luma(a), luma(b), []
    for y in range(20 - 6):
        for x in range(24 - 6):
            p, q = first[y : y + 7, x : x + 7].ravel(), second[y : y + 7, x : x + 7].ravel()
            c = np.cov(p, q)
            brightness = (2 * p.mean() * q.mean() + 6.5025) / (p.mean() ** 2 + q.mean() ** 2 + 6.5025)
            found.append(brightness * (2 * c[0, 1] + 58.5225) / (c[0, 0] + c[1, 1] + 58.5225))
    assert ssim(a, png(b)) == pytest.approx(np.mean(found), abs=1e-12)
    assert ssim(a, png(a)) == pytest.approx(1, abs=1e-12)


def test_each_encoder_reaches_the_ssim_of_the_reference():
    y, x = np.mgrid[:64, :64]
    bright = 128 + 60 * np.sin(x / 5) + 40 * np.sin(y / 3 + x / 11)
    tile = np.stack([bright, bright + 10, bright - 20], -1).astype(np.uint8)
    rows = compare([tile], rounds=1)
    assert (rows[0].encoder, rows[0].bytes_ratio) == ("webp method 0", 1)
    assert all(row.ssim >= rows[0].ssim for row in rows[1:])
