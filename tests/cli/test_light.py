"""Rendered sun and ambient occlusion layers: a house on a plain, seen from above, compared with computed shadows."""

import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.catalogue import RenderingRecord, Workspace
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import TileId, Vec3
from tests.cli.towns import Run, house

pytestmark = pytest.mark.whole

EAST_45 = ("--sun", "90,45")
PLACE = ("--place", "48.76,11.42")
DAY = ("--date", "2026-06-21", *PLACE)
HEIGHT_M = 10.0
NOTHING = 0xFFFFFFFF
LAYERS = "color,data,sun,sun16,ao,depth2,picture"


@dataclass
class Plain:
    """A house of 8 × 10 m at the origin, its long side to the north, on a plain of 160 m; local metres."""

    run: Run
    workspace: Workspace

    def make(self, name: str, *options: str) -> None:
        status, _, err = self.run("create-rendering", "plain", name, "--res", "0.25", "--view", "0/90", "--view", "30/45", "--color", "png", *options)
        assert status == 0, err
        self.render(name)

    def add(self, name: str, *options: str) -> None:
        status, _, err = self.run("add-layers", name, "--color", "png", *options)
        assert status == 0, err
        self.render(name)

    def render(self, name: str) -> None:
        status, _, err = self.run("render", name)
        assert status == 0, err

    def record(self, name: str) -> RenderingRecord:
        catalogue = self.workspace.open_catalogue()
        try:
            return catalogue.rendering(name)
        finally:
            catalogue.close()

    def tiles(self, name: str) -> dict[tuple[str, str], dict[TileId, bytes]]:
        """Returns (view, layer) → tiles."""
        found = {}
        record = self.record(name)
        for track in record.tracks:
            with SqliteTileStore(self.workspace.store_path(name, track.id), read_only=True) as store:
                for number, layer in enumerate(track.layers):
                    listed = {tile: store.get_tile(number, *tile) for tile in store.list_tiles(number)}
                    found[track.frame.id, layer.name] = {tile: data for tile, data in listed.items() if data is not None}
        return found

    def pixel_reader(self, name: str) -> Callable[..., np.ndarray]:
        """Returns read_pixel(layer, x, y, z=0), which returns the bytes of the pixel at a local point in the view from above."""
        frame, tiles = self.record(name).frames[0], self.tiles(name)

        def read_pixel(layer: str, x: float, y: float, z: float = 0.0) -> np.ndarray:
            px, py, _ = frame.level_pixel_from_local(frame.zmax, [x, y, z])
            column, row = int(px) // frame.tile_px, int(py) // frame.tile_px
            with Image.open(io.BytesIO(tiles[frame.id, layer][TileId(frame.zmax, column, row)])) as image:
                pixels = np.asarray(image)
            return np.atleast_1d(pixels[int(py) % frame.tile_px, int(px) % frame.tile_px])

        return read_pixel


@pytest.fixture
def plain(run: Run, tmp_path: Path) -> Plain:
    files = tmp_path / "files"
    files.mkdir()
    (files / "house.obj").write_text(house(0.0, 0.0, HEIGHT_M))
    (files / "ground.obj").write_text("v -80 -80 0\nv 80 -80 0\nv 80 80 0\nv -80 80 0\nf 1 2 3 4\n")
    assert run("create-scene", "plain", "--ground-plane", "off")[0] == 0
    assert run("add-files", "plain", str(files))[0] == 0
    return Plain(run, Workspace(tmp_path / "workspace"))


def number(pixel: np.ndarray) -> int:
    """Returns the little-endian number."""
    return int.from_bytes(pixel.tobytes(), "little")


def linear(byte: np.ndarray) -> np.ndarray:
    share = byte / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def test_small_tiles_have_equal_pixels_and_fewer_bytes(plain: Plain) -> None:
    layers = ("--layers", "color,normal,id,depth,sun", *EAST_45)
    plain.make("quick", *layers)
    plain.make("small", *layers, "--small")
    quick, small = plain.tiles("quick"), plain.tiles("small")
    assert quick.keys() == small.keys()
    for place, tiles in quick.items():
        assert tiles.keys() == small[place].keys()
        for tile, data in tiles.items():
            assert np.array_equal(*(np.asarray(Image.open(io.BytesIO(found))) for found in (data, small[place][tile]))), (place, tile)
        size, smaller = sum(map(len, tiles.values())), sum(map(len, small[place].values()))
        assert smaller == size if place[1] == "sun" else smaller < size, place


def test_shadow_at_45_degrees_is_as_long_as_the_house_is_high(plain: Plain) -> None:
    plain.make("r", "--layers", "sun", *EAST_45)
    read_pixel = plain.pixel_reader("r")
    for x in (-0.5, -5.0, -9.5):
        assert read_pixel("sun", x, 5.0).tolist() == [0], "to the west of the wall"
    for x, y, z in ((-10.5, 5.0, 0.0), (15.0, 5.0, 0.0), (-5.0, -0.5, 0.0), (-5.0, 10.5, 0.0), (4.0, 5.0, HEIGHT_M)):
        assert read_pixel("sun", x, y, z).tolist() == [255]


def test_each_bit_of_sun16_is_the_shadow_of_one_hour(plain: Plain) -> None:
    plain.make("r", "--layers", "sun16", *DAY)
    read_pixel = plain.pixel_reader("r")
    frame = plain.record("r").frames[0]
    (suns,) = (layer.suns for layer in plain.record("r").layers)
    pixel_m = frame.pixel_m(frame.zmax)
    column, row, _ = (int(value) for value in frame.level_pixel_from_local(frame.zmax, [-30.0, 30.0, 0.0]))
    places = [(column + 17 * i, row + 17 * j) for i in range(14) for j in range(14)]
    middles = [(frame.u0_m + (i + 0.5) * pixel_m, frame.v0_m - (j + 0.5) * pixel_m, 0.0) for i, j in places]
    ground = [(x, y, z) for x, y, z in middles if not (-0.5 < x < 8.5 and -0.5 < y < 10.5)]
    assert len(ground) > 50
    bits = [number(read_pixel("sun16", *place)) for place in ground]
    for hour, sun in enumerate(suns):
        expected = [sun.direction[2] > 0 and not _hits_house(place, sun.direction) for place in ground]
        assert [bit >> hour & 1 == 1 for bit in bits] == expected, sun.time
        assert not sun.direction[2] > 0.3 or {True, False} == set(expected)


def _hits_house(place: Vec3, direction: Vec3) -> bool:
    """Whether a ray from 1/64 m above the point hits the box (slab test)."""
    near, far = 0.0, np.inf
    for at, step, high in zip((*place[:2], place[2] + 1 / 64), direction, (8.0, 10.0, HEIGHT_M), strict=True):
        first, last = sorted(((0.0 - at) / step, (high - at) / step))
        near, far = max(near, first), min(far, last)
    return bool(near < far)


def test_corners_are_darker_than_the_plain_and_less_so_with_a_small_radius(plain: Plain) -> None:
    plain.make("r", "--layers", "ao", "--ao-radius", "30")
    plain.add("r", "--layers", "near=ao", "--ao-radius", "2")
    read_pixel = plain.pixel_reader("r")
    foot, away = int(read_pixel("ao", -0.5, 5.0)[0]), int(read_pixel("ao", -60.0, 60.0)[0])
    assert 100 < foot < 190
    assert away == 255
    assert int(read_pixel("ao", 4.0, 5.0, HEIGHT_M)[0]) == 255, "the roof is open"
    assert int(read_pixel("near", -5.0, 5.0)[0]) == 255 > int(read_pixel("ao", -5.0, 5.0)[0])


def test_depth2_is_the_ground_behind_the_roof_and_empty_behind_the_ground(plain: Plain) -> None:
    plain.make("r", "--layers", "depth,depth2")
    read_pixel = plain.pixel_reader("r")
    roof = number(read_pixel("depth2", 4.0, 5.0, HEIGHT_M)) - number(read_pixel("depth", 4.0, 5.0, HEIGHT_M))
    assert roof == pytest.approx(HEIGHT_M * 1024, abs=2)
    assert number(read_pixel("depth2", -30.0, 5.0)) == NOTHING


def test_picture_is_color_lit_by_sun_and_sky(plain: Plain) -> None:
    plain.make("r", "--layers", "color,sun,ao,picture", *EAST_45)
    read_pixel = plain.pixel_reader("r")
    for x, y, z in ((-5.0, 5.0, 0.0), (-30.0, 5.0, 0.0), (4.0, 5.0, HEIGHT_M)):
        lit, open_ = read_pixel("sun", x, y, z)[0] / 255, read_pixel("ao", x, y, z)[0] / 255
        light = 0.42 * open_ + 0.76 * 0.5**0.5 * lit
        color, picture = read_pixel("color", x, y, z), read_pixel("picture", x, y, z)
        assert np.minimum(linear(color[:3]) * light, 1.0) == pytest.approx(linear(picture[:3]), abs=0.02)
        assert picture[3:].tolist() == color[3:].tolist(), "coverage, where the tile has any"


def test_added_layers_equal_those_created_with_the_rendering(plain: Plain) -> None:
    light = ("--time", "2026-06-21T15:00+02:00", *DAY, "--ao-radius", "10")
    plain.make("whole", "--layers", LAYERS, *light)
    plain.make("less")
    before = plain.tiles("less")
    plain.add("less", "--layers", "sun,ao", "--time", "2026-06-21T15:00+02:00", *PLACE, "--ao-radius", "10")
    plain.add("less", "--layers", "sun16,depth2,picture", *light)
    after = plain.tiles("less")
    assert {place: after[place] for place in before} == before
    assert after == plain.tiles("whole")
    status, out, err = plain.run("verify", "--json")
    assert (status, json.loads(out)["wrong"]) == (0, []), err
    status, out, err = plain.run("estimate", "less", "--json")
    assert (status, json.loads(out)["open_tiles"]) == (0, 0), err
