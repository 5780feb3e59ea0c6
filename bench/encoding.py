"""Bytes and milliseconds per tile and layer, for the core's encoders and others: `python -m bench encoding`."""

import io
import json
import time
import zlib
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

TilePixels = NDArray[np.uint8]
Encode = Callable[[int], bytes]
"""Encodes the tile of a number."""
QUALITIES = (60, 70, 80, 90)
DATA = ("normal", "id", "depth")


@dataclass(frozen=True)
class EncodingRow:
    """Means over the tiles; `psnr_db`: in sRGB over fully covered pixels, None if lossless."""

    layer: str
    encoder: str
    bytes: float
    ms: float
    psnr_db: float | None


def measure(buildings: int = 300, res_m: float = 0.2, count: int = 48, rounds: int = 3) -> list[dict[str, Any]]:
    """Measures all layers and prints the table, also as Markdown. Encoders take turns; the fastest round counts."""
    folder, frames = prepare_scene(buildings, res_m, "webp")
    frame = core_frame(next(iter(frames.values())))
    scene = _core.Scene(str(folder), 1 << 30)
    buffers = [scene.gbuffer(frame, *tile) for tile in choose_tiles(scene, frame, count)]
    rows = [row for layer in ("color", *DATA) for row in measure_layer(layer, buffers, rounds)]
    rows += measure_data_tiles(buffers, rounds) + measure_whole_tiles(buffers, rounds)
    _print(rows, len(buffers))
    return [asdict(row) for row in rows]


def measure_layer(layer: str, buffers: list[dict[str, NDArray[Any]]], rounds: int) -> list[EncodingRow]:
    arrays = [buffer[layer] for buffer in buffers]
    pixels = [_core.decode_png(_core.encode_layer(layer, "png", array)) for array in arrays]
    encoders = _color_encoders(arrays, pixels) if layer == "color" else _data_encoders(layer, arrays, pixels)
    numbers = range(len(arrays))
    spent = {name: min(times) for name, times in _time_encoders(encoders, numbers, rounds).items()}
    rows = []
    for name, encode in encoders.items():
        done = [encode(number) for number in numbers]
        lossy = layer == "color" and not name.endswith(LOSSLESS)
        quality = np.mean([_psnr(pixels[number], done[number]) for number in numbers]) if lossy else None
        rows.append(
            EncodingRow(layer, name, float(np.mean([len(data) for data in done])), 1000 * spent[name] / len(done), quality and float(quality))
        )
    return rows


def measure_data_tiles(buffers: list[dict[str, NDArray[Any]]], rounds: int) -> list[EncodingRow]:
    """Measures normal, id and depth together: as one data tile, and as three PNGs."""

    tiles = [_encode_data_tile(buffer) for buffer in buffers]

    def decode(number: int) -> bytes:
        _core.decode_data_tile(tiles[number])
        return tiles[number]

    works: dict[str, Encode] = {
        "core data tile": lambda number: _encode_data_tile(buffers[number]),
        "core data tile, small": lambda number: _encode_data_tile(buffers[number], small=True),
        "core, three PNGs": lambda number: _encode_pngs(buffers[number]),
        "core data tile, decoding": decode,
    }
    return _measure_works("normal, id, depth", works, len(buffers), rounds)


def measure_whole_tiles(buffers: list[dict[str, NDArray[Any]]], rounds: int) -> list[EncodingRow]:
    """Measures the four layers of a tile: the default, and what it was before data tiles."""

    def color(number: int) -> bytes:
        return _core.encode_layer("color", "webp", buffers[number]["color"], 80)

    works: dict[str, Encode] = {
        "core webp q80 and data tile": lambda number: color(number) + _encode_data_tile(buffers[number]),
        "core webp q80 and three PNGs": lambda number: color(number) + _encode_pngs(buffers[number]),
    }
    return _measure_works("all four", works, len(buffers), rounds)


def _encode_data_tile(buffer: dict[str, NDArray[Any]], small: bool = False) -> bytes:
    return _core.encode_data_tile(*(buffer[layer] for layer in DATA), small)


def _encode_pngs(buffer: dict[str, NDArray[Any]]) -> bytes:
    return b"".join(_core.encode_layer(layer, "png", buffer[layer]) for layer in DATA)


def _measure_works(layer: str, works: dict[str, Encode], count: int, rounds: int) -> list[EncodingRow]:
    spent = {name: min(times) for name, times in _time_encoders(works, range(count), rounds).items()}
    sizes = {name: float(np.mean([len(work(number)) for number in range(count)])) for name, work in works.items()}
    return [EncodingRow(layer, name, sizes[name], 1000 * spent[name] / count, None) for name in works]


def _time_encoders(encoders: dict[str, Encode], numbers: range, rounds: int) -> dict[str, list[float]]:
    times: dict[str, list[float]] = {name: [] for name in encoders}
    for _ in range(rounds):
        for name, encode in encoders.items():
            begun = time.process_time()
            for number in numbers:
                encode(number)
            times[name].append(time.process_time() - begun)
    return times


LOSSLESS = ("png", "png, small", "lossless", "level 1", "level 6", "level 9")


def _color_encoders(arrays: list[NDArray[Any]], pixels: list[TilePixels]) -> dict[str, Encode]:
    images = [Image.fromarray(tile) for tile in pixels]
    plain = [image.convert("RGB") for image in images]
    found: dict[str, Encode] = {}
    for form in ("webp", "jpeg"):
        for quality in QUALITIES:
            found[f"core {form} q{quality}"] = lambda k, form=form, quality=quality: _core.encode_layer("color", form, arrays[k], quality)
    found["core webp q80 small"] = lambda k: _core.encode_layer("color", "webp", arrays[k], 80, True)
    found["core png"] = lambda k: _core.encode_layer("color", "png", arrays[k])
    for method in (0, 4, 6):
        found[f"Pillow webp q80 method {method}"] = lambda k, method=method: _encode_with_pillow(images[k], "WEBP", quality=80, method=method)
    for name, sampling in (("4:4:4", 0), ("4:2:0", 2)):
        found[f"Pillow jpeg q80 {name}"] = lambda k, sampling=sampling: _encode_with_pillow(plain[k], "JPEG", quality=80, subsampling=sampling)
    found["Pillow jpeg q80 4:2:0 optimised"] = lambda k: _encode_with_pillow(plain[k], "JPEG", quality=80, optimize=True)
    found["Pillow avif q60 speed 10"] = lambda k: _encode_with_pillow(images[k], "AVIF", quality=60, speed=10, max_threads=1)
    return found | _lossless_encoders(images)


def _data_encoders(layer: str, arrays: list[NDArray[Any]], pixels: list[TilePixels]) -> dict[str, Encode]:
    images = [Image.fromarray(tile) for tile in pixels]
    found: dict[str, Encode] = {
        "core png": lambda k: _core.encode_layer(layer, "png", arrays[k]),
        "core png, small": lambda k: _core.encode_layer(layer, "png", arrays[k], 80, True),
    }
    raw = [tile.tobytes() for tile in pixels]
    for level in (1, 6, 9):
        found[f"zlib of the raw bytes, level {level}"] = lambda k, level=level: zlib.compress(raw[k], level)
    return found | _lossless_encoders(images)


def _lossless_encoders(images: list[Image.Image]) -> dict[str, Encode]:
    found: dict[str, Encode] = {}
    for level in (1, 6, 9):
        found[f"Pillow png level {level}"] = lambda k, level=level: _encode_with_pillow(images[k], "PNG", compress_level=level)
    for method in (0, 4):
        found[f"Pillow webp method {method} lossless"] = lambda k, method=method: _encode_with_pillow(
            images[k], "WEBP", lossless=True, exact=True, method=method, quality=50
        )
    return found


def _encode_with_pillow(image: Image.Image, form: str, **options: Any) -> bytes:
    out = io.BytesIO()
    image.save(out, form, **options)
    return out.getvalue()


def _psnr(tile: TilePixels, data: bytes) -> float:
    seen = np.array(Image.open(io.BytesIO(data)).convert("RGB"), float)
    covered = tile[..., 3] == 255 if tile.shape[-1] == 4 else np.ones(tile.shape[:2], bool)
    error = ((seen - tile[..., :3])[covered] ** 2).mean()
    return float(10 * np.log10(255**2 / max(error, 1e-9)))


def _print(rows: list[EncodingRow], count: int) -> None:
    table = Table(title=f"encoding, means of {count} tiles, one core", title_justify="left")
    for column in ("layer", "encoder", "bytes", "ms", "PSNR, dB"):
        table.add_column(column, justify="left" if column in ("layer", "encoder") else "right")
    lines = [(row.layer, row.encoder, f"{row.bytes:,.0f}", f"{row.ms:.2f}", "" if row.psnr_db is None else f"{row.psnr_db:.1f}") for row in rows]
    for line in lines:
        table.add_row(*line)
    Console().print(table)
    print("\n".join(f"| {' | '.join(line)} |" for line in lines))


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
