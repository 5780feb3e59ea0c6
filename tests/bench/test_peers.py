"""Parts of the benchmarks whose errors would go unnoticed: tile squares, ratios, plots, copies."""

import hashlib
import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bench.peer_comparison import PeerRow, best_ratios, choose_squares, judged, print_tables, with_color_format
from bench.peers import PeerMissing, with_larger_tiles
from bench.renderer_pool import RendererPool
from bench.svg_plot import plot

FRAME = {"tile_px": 256, "zmax": 5, "size_m": 320.0, "u0_m": -10.0, "v0_m": 20.0, "look_at_deg": 30.0, "pitch_deg": 45.0}


class Counter:
    """A renderer that can be missing."""

    def __init__(self, missing: bool = False) -> None:
        if missing:
            raise PeerMissing("not here")
        self.drawn = 0

    def draw(self, frame: dict, x: int, y: int) -> None:
        self.drawn += 1

    def count(self) -> int:
        return self.drawn


@pytest.mark.parametrize("doublings", [1, 2, 3])
def test_larger_tile_covers_its_tiles_at_the_same_resolution(doublings: int) -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)
    from bench.peers.scene_parts import tile_square

    wide = tile_square(with_larger_tiles(FRAME, doublings), 1, 2)
    first = tile_square(FRAME, 1 << doublings, 2 << doublings)
    assert wide.side_m / wide.px == first.side_m / first.px
    assert wide.u_m - wide.side_m / 2 == pytest.approx(first.u_m - first.side_m / 2)
    assert wide.v_m + wide.side_m / 2 == pytest.approx(first.v_m + first.side_m / 2)


def test_squares_with_most_tiles_come_first() -> None:
    tiles = [(0, 0), (4, 4), (4, 5), (5, 4), (5, 5), (2, 2), (3, 3)]
    assert choose_squares(tiles, 1, 2) == [(2, 2), (1, 1)]
    assert set(choose_squares(tiles, 0, 7)) == set(tiles)


def test_only_the_colour_layer_changes_format() -> None:
    frame = {"layers": [{"kind": "color", "format": "webp"}, {"kind": "id", "format": "png"}]}
    assert with_color_format(frame, "jpeg")["layers"] == [{"kind": "color", "format": "jpeg"}, {"kind": "id", "format": "png"}]
    assert frame["layers"][0]["format"] == "webp"


def test_ratios_are_over_the_best_peer() -> None:
    found = (("a", 256, 9.0), ("b", 256, 7.0), ("a", 512, 4.0))
    rows = [PeerRow(peer, px, 1, 1, 1.0, {}, {"webp": ratio, "jpeg": 2 * ratio}) for peer, px, ratio in found]
    assert [found["webp"] for found in best_ratios(rows).values()] == [7.0, 4.0]
    assert best_ratios([]) == {}


def test_every_ratio_is_printed_with_its_goal(capsys: pytest.CaptureFixture[str]) -> None:
    rates = {"webp": 50.0, "jpeg": 60.0}
    rows = [PeerRow("a", 256, 1, 1, 3.0, rates, {"webp": 14.9, "jpeg": 15.0}), PeerRow("b", 512, 1, 1, 9.0, rates, {"webp": 5.1, "jpeg": 5.2})]
    print_tables(rows, [])
    printed = capsys.readouterr().out
    goals = {name: next(line.split("│")[-2].strip() for line in printed.splitlines() if line.startswith(f"│ {name} ")) for name in "ab"}
    assert goals == {"a": "15 ×", "b": "5 ×"}
    assert "best size: webp 5.1 × (met), jpeg 5.2 × (met); goal 5 ×" in printed
    assert judged(14.9, 15.0) == "14.9 × (missed)"


def test_pool_distributes_tiles_to_all_processes() -> None:
    with RendererPool("counter", Counter, 2) as pool:
        assert pool.time_draws(FRAME, [(0, 0), (1, 0), (2, 0)]) > 0
        assert pool.call("count") == 2


def test_missing_peer_raises() -> None:
    with pytest.raises(PeerMissing, match="not here"):
        RendererPool("counter", partial(Counter, True))


def test_plot_contains_every_point(tmp_path: Path) -> None:
    plot(tmp_path / "p.svg", "t <", "x", "y", {"a": [(1, 2.0), (10, 4.0), (100, 3.0)], "b": [(1, 1.0)]})
    text = (tmp_path / "p.svg").read_text()
    places = [tuple(map(float, found)) for found in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', text)]
    assert len(places) == 4
    assert "t &lt;" in text
    (x1, y1), (x2, y2), (x3, _), _ = places
    assert x2 - x1 == pytest.approx(x3 - x2, abs=0.2)
    assert y2 < y1


def test_copies_fill_squares() -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)
    from bench.district import copy_position

    for side in (1, 2, 3, 10):
        assert {copy_position(number) for number in range(side * side)} == {(column, row) for column in range(side) for row in range(side)}


def test_copy_is_translated_and_has_its_own_images(tmp_path: Path) -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)
    from bench.district import copy_asset
    from PIL import Image

    from map3d import _core

    source = tmp_path / "source"
    (source / "textures").mkdir(parents=True)
    image = tmp_path / "image.jpg"
    Image.fromarray(np.arange(768, dtype=np.uint8).reshape(16, 16, 3)).save(image)
    key = hashlib.sha256(image.read_bytes()).hexdigest()[:32]
    image.rename(source / "textures" / f"{key}.jpg")
    writer = _core.AssetWriter(str(source))
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 5]])
    writer.append_mesh(corners, np.array([[0, 1, 2]], np.uint32), np.zeros((1, 3, 2), np.float32), 0, 0, 3)
    material = {"name": "m", "diffuse": [1, 1, 1, 1], "texture": key, "alpha": None, "wrap": "none", "border": [0, 0, 0, 0], "cutout": False}
    objects = [{"name": "o", "class": "building", "parent": None, "lod": None, "attributes": {}}]
    writer.set_tables(json.dumps({"materials": [material], "instances": []}), json.dumps(objects))
    writer.finish(None)
    copy_asset(source, tmp_path / "copy", "copy 1", np.array([100.0, 200.0, 0.0]))
    assert np.array_equal(_core.AssetMesh(str(tmp_path / "copy" / "mesh.m3a")).positions, corners + np.array([100.0, 200.0, 0.0]))
    (other,) = (tmp_path / "copy" / "textures").iterdir()
    assert other.stem != key
    assert json.loads((tmp_path / "copy" / "materials.json").read_text())["materials"][0]["texture"] == other.stem
    assert np.array_equal(np.array(Image.open(other)), np.array(Image.open(source / "textures" / f"{key}.jpg")))


@pytest.mark.parametrize("kinds", [("color", "data"), ("color", "normal", "id", "depth")])
def test_own_renderer_encodes_the_layers_of_every_profile(kinds: tuple[str, ...]) -> None:
    core = pytest.importorskip("map3d._core", reason="the compiled core is missing", exc_type=ImportError)
    from bench.peers.map3d_peer import encode_tile

    buffer = {
        "color": np.full((8, 8, 4), 65535, np.uint16),
        "normal": np.tile(np.array([0, 0, 32767], np.int16), (8, 8, 1)),
        "id": np.full((8, 8), 17, np.uint32),
        "depth": np.full((8, 8), 2048, np.uint32),
    }
    encoded = encode_tile([core.LayerSpec(kind, {"color": "webp", "data": "m3d"}.get(kind, "png")) for kind in kinds], buffer)
    assert len(encoded) == len(kinds)
    decoded = core.decode_data_tile(encoded[1])["id"] if "data" in kinds else core.decode_png(encoded[2])[..., 0]
    assert (decoded == 17).all()
