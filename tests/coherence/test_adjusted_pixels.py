"""Pixels and registered boxes of objects whose heights were adjusted have the true place, to the centimetre."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

from map3d.geometry.core_frame import core_frame
from map3d.geometry.frames import pin
from map3d.registry import Registry
from map3d.scenes.build import open_scene
from map3d.tiles.occupancy import xy_from_morton
from map3d.types import TileId, ViewAngles
from tests.coherence.documents import EAST, House, Scene, new_scene, road, slope, town, write_dem, write_flat, write_houses, write_photo

TILE_PX = 256
RES_M = 0.25
EXACT_M = 0.01
LEAST_SHARE = 0.99
"""Share of pixels whose centre shows the surface that they name; at ridges and edges, another one of their samples does."""


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    with new_scene(tmp_path) as found:
        yield found


def draw(scene: Scene) -> Mapping[str, np.ndarray]:
    """Builds the scene and returns what a view from above at 50° shows of each object: name → (n, 3) world coordinates of pixels."""
    scene.build()
    built = open_scene(scene.workspace, "town")
    (pinned,) = pin(built.box, TILE_PX, RES_M, [ViewAngles(30.0, 50.0)])
    frame = core_frame(pinned.to_json())
    ids, points = [], []
    rows, columns = np.mgrid[0:TILE_PX, 0:TILE_PX]
    for x, y in zip(*(numbers.tolist() for numbers in xy_from_morton(built.occupied(frame, pinned.zmax))), strict=True):
        buffer = built.gbuffer(frame, x, y)
        seen = buffer["id"] > 0
        ids.append(buffer["id"][seen])
        points.append(pinned.local_from_pixel(TileId(pinned.zmax, x, y), columns[seen], rows[seen], buffer["depth"][seen]) + built.origin)
    number, point = np.concatenate(ids), np.concatenate(points)
    with Registry(scene.workspace.registry_path("town")) as registry:
        return {registry.get(one).name: point[number == one] for one in np.unique(number).tolist()}


def distances(house: House, points: np.ndarray) -> np.ndarray:
    """Returns the distance of points from the walls and roofs of a house of `write_houses`."""
    x, y, z = points.T
    wall = np.minimum(np.minimum(abs(x - house.x), abs(x - house.x - 10)), np.minimum(abs(y - house.y), abs(y - house.y - 8)))
    rise = house.height / 8
    roof = house.z + house.height + rise * (4 - abs(y - house.y - 4))
    return np.minimum(wall, abs(z - roof) / np.hypot(1.0, rise))


def check(scene: Scene, expected: list[House]) -> Mapping[str, np.ndarray]:
    """Compares pixels and boxes of houses with where they should be."""
    drawn, boxes = draw(scene), scene.boxes()
    pixels = [distances(house, drawn[house.name]) for house in expected]
    away = np.concatenate(pixels)
    assert min(map(len, pixels)) > 100
    assert np.mean(away <= EXACT_M) >= LEAST_SHARE, f"{np.sum(away <= EXACT_M)} of {len(away)}"
    for house in expected:
        (low, high), points = boxes[house.name], drawn[house.name]
        assert (low[2], high[2]) == pytest.approx((house.z, house.z + 1.5 * house.height), abs=1e-3)
        assert house.z - EXACT_M <= points[:, 2].min()
        assert points[:, 2].max() <= house.z + 1.5 * house.height + EXACT_M
    return drawn


def test_pixels_of_houses_as_imported(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town()))
    check(scene, town())


def test_pixels_of_moved_houses_and_of_a_draped_road(tmp_path: Path, scene: Scene) -> None:
    roads = write_flat(tmp_path / "r.gml", "tran:Road", {"r": road(0.0)})
    scene.add(write_houses(tmp_path / "a.gml", town(above=46.5)), roads, write_dem(tmp_path / "dem.tif"), heights="-46.5")
    points = check(scene, town())["r"]
    assert len(points) > 1000
    assert np.allclose(points[:, 2], slope(points[:, 0], points[:, 1]), atol=EXACT_M)


def test_pixels_of_houses_set_on_the_terrain(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town(base=0.0)), write_dem(tmp_path / "dem.tif"), heights="clamp")
    check(scene, town())


def test_pixels_of_houses_in_feet(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town(factor=1 / 0.3048)), height_unit="ft")
    check(scene, town())


def test_pixels_of_a_photo_below_moved_houses(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town()), write_photo(tmp_path / "ortho.tif"), heights="46.5")
    drawn = check(scene, [replace(house, z=house.z + 46.5) for house in town()])
    points = np.concatenate([points for name, points in drawn.items() if name.startswith("ortho")])
    near = (abs(points[:, 0] - EAST - 65) < 65) & (abs(points[:, 1] - town()[0].y - 64) < 64)
    assert np.abs(points[near, 2] - slope(points[near, 0], points[near, 1]) - 46.5).max() < 2.0
    (low, high) = next(box for name, box in scene.boxes().items() if name.startswith("ortho"))
    assert low[2] - EXACT_M <= points[:, 2].min()
    assert points[:, 2].max() <= high[2] + EXACT_M
