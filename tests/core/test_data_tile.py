"""Data tiles: what the core writes, the reference reader of the specification reads, and the other way round."""

import base64
import importlib.util
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from map3d import _core

from .built import build_houses

SPEC = Path(__file__).parents[2] / "spec"
VECTORS = json.loads((SPEC / "vectors" / "data-tiles.json").read_text())
Pixels = tuple[NDArray[np.int16], NDArray[np.uint32], NDArray[np.uint32]]


@pytest.fixture(scope="module")
def reference() -> ModuleType:
    spec = importlib.util.spec_from_file_location("data_tile", SPEC / "data_tile.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def bytes_of(row: dict[str, Any]) -> bytes:
    return base64.b64decode(row["base64"])


def packed(normals: NDArray[np.uint8]) -> list[int]:
    return [r | g << 8 | b << 16 for r, g, b in normals.reshape(-1, 3).tolist()]


def roofs(height: int, width: int, noise: int) -> Pixels:
    """Faces on slanted planes with bumps of up to `noise` units, and a corner without content."""
    draw = np.random.default_rng(noise)
    y, x = np.mgrid[0:height, 0:width]
    face = (x // 11 + y // 17) % 3
    normal = np.array([(0, 0, 32767), (23170, 0, 23170), (-23170, 0, 23170)], np.int16)[face]
    depth = 900_000 + face * 50_000 + x * (70 - 40 * face) + y * 143 + draw.integers(0, noise + 1, (height, width))
    empty = (x + y) < width // 4
    normal[empty] = 0
    return normal, np.where(empty, 0, face + 1).astype(np.uint32), np.where(empty, 0xFFFFFFFF, depth).astype(np.uint32)


@pytest.mark.parametrize("row", VECTORS["tiles"], ids=lambda row: row["name"])
def test_the_core_reads_the_vectors(row: dict[str, Any]) -> None:
    tile = _core.decode_data_tile(bytes_of(row))
    assert tile["id"].shape == tile["depth"].shape == (row["height"], row["width"])
    assert (packed(tile["normal"]), tile["id"].ravel().tolist(), tile["depth"].ravel().tolist()) == (row["normal"], row["id"], row["depth"])


@pytest.mark.parametrize("row", VECTORS["refused"], ids=lambda row: row["why"])
def test_core_and_reference_refuse_broken_tiles(reference: ModuleType, row: dict[str, Any]) -> None:
    with pytest.raises(_core.FormatError):
        _core.decode_data_tile(bytes_of(row))
    with pytest.raises(ValueError, match=r"."):
        reference.decode(bytes_of(row))


@pytest.mark.parametrize(("height", "width", "noise"), [(64, 64, 0), (31, 70, 2), (40, 300, 400), (1, 1, 0)])
@pytest.mark.parametrize("small", [False, True])
def test_the_reference_reads_what_the_core_writes(reference: ModuleType, height: int, width: int, noise: int, small: bool) -> None:
    normal, ids, depth = roofs(height, width, noise)
    data = _core.encode_data_tile(normal, ids, depth, small)
    tile = reference.decode(data)
    assert (tile["width"], tile["height"]) == (width, height)
    assert (tile["id"], tile["depth"]) == (ids.ravel().tolist(), depth.ravel().tolist())
    pixels = _core.decode_png(_core.encode_layer("normal", "png", normal))
    assert tile["normal"] == packed(pixels)
    assert np.array_equal(_core.decode_data_tile(data)["normal"], pixels)


def test_a_data_tile_has_a_fraction_of_the_bytes_of_three_pngs() -> None:
    normal, ids, depth = roofs(256, 256, 1)
    pngs = sum(len(_core.encode_layer(kind, "png", array)) for kind, array in (("normal", normal), ("id", ids), ("depth", depth)))
    assert len(_core.encode_data_tile(normal, ids, depth)) < pngs / 2


def render(scene: _core.Scene, *layers: tuple[Any, Any]) -> _core.Block:
    numbers: dict[str, Any] = {"look_at_deg": 45.0, "pitch_deg": 45.0, "u0_m": -51.2, "v0_m": 51.2, "d0_m": -1000.0, "size_m": 102.4}
    frame = _core.Frame(**numbers, tile_px=256, zmax=2, layers=[_core.LayerSpec(*layer) for layer in layers])
    return scene.render_block(frame, 0, 0, 0)


def test_a_block_with_a_data_layer_has_the_pixels_of_the_png_layers(tmp_path: Path) -> None:
    scene = build_houses(tmp_path, [(-30.0, -10.0, 12.0, 9.0), (-5.0, 0.0, 8.0, 20.0), (10.0, -15.0, 17.0, 4.0)])
    pngs = render(scene, ("color", "png"), ("normal", "png"), ("id", "png"), ("depth", "png"))
    tiles = render(scene, ("color", "png"), ("data", "m3d"))
    layers = {(layer, *tile): data for layer, *tile, data in pngs.tiles}
    assert len(tiles.tiles) == len(layers) / 2 >= 6
    for layer, *tile, data in tiles.tiles:
        if layer == 0:
            assert data == layers[0, *tile]
            continue
        decoded = _core.decode_data_tile(data)
        normal, ids, depth = (_core.decode_png(layers[number, *tile]) for number in (1, 2, 3))
        assert np.array_equal(decoded["normal"], normal)
        assert np.array_equal(decoded["id"], ids.view("<u4")[..., 0])
        assert np.array_equal(decoded["depth"], depth.view("<u4")[..., 0])
    assert tiles.seam == pngs.seam


@pytest.mark.parametrize("layer", [("data", "png"), ("depth", "m3d"), ("color", "m3d")])
def test_the_data_tile_is_the_format_of_data_alone(layer: tuple[Any, Any]) -> None:
    with pytest.raises(_core.InvalidArgument, match="its format is"):
        _core.Frame(0.0, 45.0, 0.0, 0.0, 0.0, 102.4, 256, 2, [_core.LayerSpec(*layer)])


def test_arrays_of_different_sizes_are_refused() -> None:
    normal, ids, depth = roofs(8, 8, 0)
    with pytest.raises(_core.InvalidArgument, match="data tile of 8 × 8"):
        _core.encode_data_tile(normal, ids, depth[:4])
