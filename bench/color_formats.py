"""Bytes and CPU time of lossy colour formats at equal SSIM: `python -m bench formats`."""

import io
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rich.console import Console
from rich.table import Table

from map3d import _core
from map3d.geometry.core_frame import core_frame

from .benchmark_scene import prepare_scene
from .tiles import choose_tiles

Pixels = NDArray[np.uint8]
Encode = Callable[[Image.Image, int], bytes]
"""Encodes an opaque tile at a quality of 1 to 100."""
REFERENCE_QUALITY = 80
WINDOW = 7
"""Pixels on each side of the SSIM's uniform window (Wang et al. 2004; the window of scikit-image)."""


@dataclass(frozen=True)
class FormatRow:
    """Means over the tiles; ratios are of sums, to WebP method 0 at quality 80."""

    encoder: str
    quality: float
    ssim: float
    bytes: float
    bytes_ratio: float
    ms: float
    time_ratio: float


def measure(buildings: int, res_m: float, count: int, rounds: int = 3) -> list[dict[str, Any]]:
    """Encodes each opaque tile at the least quality whose SSIM of luma is at least that of WebP method 0 at quality 80."""
    folder, frames = prepare_scene(buildings, res_m, "webp")
    frame = core_frame(next(iter(frames.values())))
    scene = _core.Scene(str(folder), 1 << 30)
    tiles = [opaque for tile in choose_tiles(scene, frame, count) if (opaque := opaque_pixels(scene.gbuffer(frame, *tile)["color"])) is not None]
    if not tiles:
        raise SystemExit("bench: no opaque tiles; choose a finer --res")
    rows = compare(tiles, rounds)
    _print(rows, len(tiles), buildings, res_m)
    return [asdict(row) for row in rows]


def opaque_pixels(color: NDArray[Any]) -> Pixels | None:
    """Returns the sRGB bytes of a tile, (H, W, 3) uint8; None if it has holes."""
    pixels: Pixels = _core.decode_png(_core.encode_layer("color", "png", color))
    return pixels if pixels.shape[-1] == 3 else None


def compare(tiles: list[Pixels], rounds: int) -> list[FormatRow]:
    images = [Image.fromarray(tile) for tile in tiles]
    webp = encoders()["webp method 0"]
    targets = [ssim(tile, webp(image, REFERENCE_QUALITY)) for tile, image in zip(tiles, images, strict=True)]
    rows: list[FormatRow] = []
    for name, encode in encoders().items():
        found = [least_quality(tile, image, encode, target) for tile, image, target in zip(tiles, images, targets, strict=True)]
        done = [encode(image, quality) for image, quality in zip(images, found, strict=True)]
        spent = 1000 * min(cpu_s(encode, images, found) for _ in range(rounds)) / len(tiles)
        size = float(np.mean([len(data) for data in done]))
        first = rows[0] if rows else None
        rows.append(
            FormatRow(
                encoder=name,
                quality=float(np.mean(found)),
                ssim=float(np.mean([ssim(tile, data) for tile, data in zip(tiles, done, strict=True)])),
                bytes=size,
                bytes_ratio=size / first.bytes if first else 1.0,
                ms=spent,
                time_ratio=spent / first.ms if first else 1.0,
            )
        )
    return rows


def encoders() -> dict[str, Encode]:
    """The reference first."""
    found: dict[str, Encode] = {}
    for method in range(5):
        found[f"webp method {method}"] = lambda image, quality, method=method: _save(image, "WEBP", quality=quality, method=method)
    for name, sampling in (("4:4:4", 0), ("4:2:0", 2)):
        for optimize in (False, True):
            found[f"jpeg {name}{', optimised Huffman tables' if optimize else ''}"] = lambda image, quality, sampling=sampling, optimize=optimize: (
                _save(image, "JPEG", quality=quality, subsampling=sampling, optimize=optimize)
            )
    return found


def least_quality(tile: Pixels, image: Image.Image, encode: Encode, target: float) -> int:
    """Returns the least quality that reaches an SSIM, by bisection; 100 if none does."""
    low, high = 1, 100
    while low < high:
        middle = (low + high) // 2
        if ssim(tile, encode(image, middle)) >= target:
            high = middle
        else:
            low = middle + 1
    return low


def cpu_s(encode: Encode, images: list[Image.Image], qualities: list[int]) -> float:
    begun = time.process_time()
    for image, quality in zip(images, qualities, strict=True):
        encode(image, quality)
    return time.process_time() - begun


def ssim(tile: Pixels, data: bytes) -> float:
    """Returns the mean SSIM of luma (BT.601) between a tile and an encoded image, in float64."""
    a, b = luma(tile), luma(np.array(Image.open(io.BytesIO(data)).convert("RGB")))
    n = WINDOW * WINDOW
    mean_a, mean_b = window_means(a), window_means(b)
    unbiased = n / (n - 1)
    var_a = unbiased * (window_means(a * a) - mean_a**2)
    var_b = unbiased * (window_means(b * b) - mean_b**2)
    cov = unbiased * (window_means(a * b) - mean_a * mean_b)
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return float(np.mean((2 * mean_a * mean_b + c1) * (2 * cov + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))))


def luma(pixels: Pixels) -> NDArray[np.float64]:
    return pixels.astype(np.float64) @ np.array([0.299, 0.587, 0.114])


def window_means(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Means of all windows that lie within the image."""
    sums = np.pad(values, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    k = WINDOW
    inside: NDArray[np.float64] = (sums[k:, k:] - sums[:-k, k:] - sums[k:, :-k] + sums[:-k, :-k]) / (k * k)
    return inside


def _save(image: Image.Image, form: str, **options: Any) -> bytes:
    out = io.BytesIO()
    image.save(out, form, **options)
    return out.getvalue()


def _print(rows: list[FormatRow], count: int, buildings: int, res_m: float) -> None:
    table = Table(
        title=f"colour at the SSIM of WebP q{REFERENCE_QUALITY}: {count} opaque tiles, {buildings} buildings at {res_m} m per pixel",
        title_justify="left",
    )
    for column in ("encoder", "quality", "SSIM", "bytes", "ratio", "CPU ms", "ratio of times"):
        table.add_column(column, justify="left" if column == "encoder" else "right")
    for row in rows:
        table.add_row(
            row.encoder,
            f"{row.quality:.0f}",
            f"{row.ssim:.4f}",
            f"{row.bytes:,.0f}",
            f"{row.bytes_ratio:.2f}",
            f"{row.ms:.2f}",
            f"{row.time_ratio:.2f}",
        )
    Console().print(table)
