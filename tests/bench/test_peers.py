"""The parts of the benchmarks that can be wrong without anybody noticing: which ground is drawn, which figures are reported, what a copy is."""

import hashlib
import json
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bench.beside import Row, colored, fullest, ratios
from bench.crew import Crew
from bench.peers import Missing, wider
from bench.plot import plot

FRAME = {"tile_px": 256, "zmax": 5, "size_m": 320.0, "u0_m": -10.0, "v0_m": 20.0, "look_at_deg": 30.0, "pitch_deg": 45.0}


class Counter:
    """A drawer that fails on demand."""

    def __init__(self, missing: bool = False) -> None:
        if missing:
            raise Missing("not here")
        self.drawn = 0

    def draw(self, frame: dict, x: int, y: int) -> None:
        self.drawn += 1

    def count(self) -> int:
        return self.drawn


@pytest.mark.parametrize("doublings", [1, 2, 3])
def test_a_wider_tile_shows_the_ground_of_its_tiles_at_the_same_pixels(doublings: int) -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
    from bench.peers.parts import square

    wide = square(wider(FRAME, doublings), 1, 2)
    first = square(FRAME, 1 << doublings, 2 << doublings)
    assert wide.side_m / wide.px == first.side_m / first.px
    assert wide.u_m - wide.side_m / 2 == pytest.approx(first.u_m - first.side_m / 2)
    assert wide.v_m + wide.side_m / 2 == pytest.approx(first.v_m + first.side_m / 2)


def test_the_fullest_squares_come_first() -> None:
    tiles = [(0, 0), (4, 4), (4, 5), (5, 4), (5, 5), (2, 2), (3, 3)]
    assert fullest(tiles, 1, 2) == [(2, 2), (1, 1)]
    assert set(fullest(tiles, 0, 7)) == set(tiles)


def test_only_the_colour_layer_changes_its_format() -> None:
    frame = {"layers": [{"kind": "color", "format": "webp"}, {"kind": "id", "format": "png"}]}
    assert colored(frame, "jpeg")["layers"] == [{"kind": "color", "format": "jpeg"}, {"kind": "id", "format": "png"}]
    assert frame["layers"][0]["format"] == "webp"


def test_ratios_are_over_the_best_peer() -> None:
    found = (("a", 256, 9.0), ("b", 256, 7.0), ("a", 512, 4.0))
    rows = [Row(peer, px, 1, 1, 1.0, {}, {"webp": ratio, "jpeg": 2 * ratio}) for peer, px, ratio in found]
    assert [found["webp"] for found in ratios(rows).values()] == [7.0, 4.0]
    assert ratios([]) == {}


def test_a_crew_deals_places_out_to_all_its_processes() -> None:
    with Crew("counter", Counter, 2) as crew:
        assert crew.seconds(FRAME, [(0, 0), (1, 0), (2, 0)]) > 0
        assert crew.ask("count") == 2


def test_a_peer_that_cannot_be_had_is_told() -> None:
    with pytest.raises(Missing, match="not here"):
        Crew("counter", partial(Counter, True))


def test_a_plot_holds_every_point(tmp_path: Path) -> None:
    plot(tmp_path / "p.svg", "t <", "x", "y", {"a": [(1, 2.0), (10, 4.0), (100, 3.0)], "b": [(1, 1.0)]})
    text = (tmp_path / "p.svg").read_text()
    places = [tuple(map(float, found)) for found in re.findall(r'<circle cx="([\d.]+)" cy="([\d.]+)"', text)]
    assert len(places) == 4
    assert "t &lt;" in text
    (x1, y1), (x2, y2), (x3, _), _ = places
    assert x2 - x1 == pytest.approx(x3 - x2, abs=0.2)
    assert y2 < y1


def test_copies_fill_squares() -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
    from bench.district import place

    for side in (1, 2, 3, 10):
        assert {place(number) for number in range(side * side)} == {(column, row) for column in range(side) for row in range(side)}


def test_a_copy_is_moved_whole_and_has_images_of_its_own(tmp_path: Path) -> None:
    pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)
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
