"""The bases of objects are compared with the ground below them; what contradicts it is named, and moved where a rule or the user says so."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from pyproj import Transformer

from map3d.errors import BadRequest
from tests.coherence.documents import (
    EAST,
    NORTH,
    Scene,
    new_scene,
    road,
    slope,
    town,
    write_dem,
    write_flat,
    write_houses,
    write_photo,
)
from tests.ingest.terrain import rasters
from tests.odd_cities.towns import at, write_citygml

pytest.importorskip("map3d._core", reason="the compiled core is not there", exc_type=ImportError)

NEW_YORK = (-73.98, 40.75)
CONTRADICTIONS = {
    "heights-at-zero",
    "heights-in-feet",
    "terrain-in-feet",
    "heights-ellipsoidal",
    "terrain-ellipsoidal",
    "heights-below-terrain",
    "heights-above-terrain",
    "objects-off-ground",
    "heights-in-metres",
    "flat-objects-draped",
    "photo-below-objects",
}


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    with new_scene(tmp_path) as found:
        yield found


def bases(scene: Scene) -> np.ndarray:
    """Returns the lowest heights of the houses, in their order."""
    boxes = scene.boxes()
    return np.array([boxes[house.name][0][2] for house in town()])


def grounds() -> np.ndarray:
    return np.array([house.z for house in town()])


def test_a_town_on_its_terrain_is_left_as_it_is(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town(above=-0.4)), write_dem(tmp_path / "dem.tif"))
    assert not scene.codes() & CONTRADICTIONS
    assert not list(scene.workspace.root.rglob("adjustments.m3h"))


@pytest.mark.parametrize(
    ("above", "code", "offset"),
    [
        (-505.0, "heights-below-terrain", "+505.0"),
        (85.0, "heights-above-terrain", "-85.0"),
        (46.5, "heights-ellipsoidal", "-46.5"),
        (-46.5, "terrain-ellipsoidal", "+46.5"),
    ],
)
def test_what_is_above_or_below_the_terrain_is_named_with_the_option_that_answers(
    tmp_path: Path, scene: Scene, above: float, code: str, offset: str
) -> None:
    files = [write_houses(tmp_path / "a.gml", town(above=above)), write_dem(tmp_path / "dem.tif")]
    scene.add(*files)
    found = scene.the(code)
    assert (found.count, found.reason.values["offset"]) == (16, offset)
    assert f"--heights {offset}" in str(found)
    assert scene.codes() & CONTRADICTIONS == {code}
    assert np.allclose(bases(scene), grounds() + above, atol=1e-3), "nothing is moved without an answer"
    scene.add(*files, heights=offset)
    assert scene.codes() & CONTRADICTIONS == set()
    assert scene.the("heights-moved").count == 16
    assert np.allclose(bases(scene), grounds(), atol=1e-3)


def test_houses_at_height_0_are_set_on_the_terrain_on_request(tmp_path: Path, scene: Scene) -> None:
    files = [write_houses(tmp_path / "a.gml", town(base=0.0)), write_dem(tmp_path / "dem.tif")]
    scene.add(*files)
    assert scene.the("heights-at-zero").count == 16
    scene.add(*files, heights="clamp")
    assert scene.the("objects-clamped").count == 16
    assert np.allclose(bases(scene), grounds(), atol=1.0)
    (low, high), _ = scene.build()
    assert low[2] > 490
    assert high[2] < 540
    scene.add(*files, heights="auto")
    assert np.allclose(bases(scene), 0.0), "without the option, everything is as before"


def test_heights_in_feet_are_named(tmp_path: Path, scene: Scene) -> None:
    files = [write_houses(tmp_path / "a.gml", town(factor=1 / 0.3048)), write_dem(tmp_path / "dem.tif")]
    scene.add(*files)
    assert scene.codes() & CONTRADICTIONS == {"heights-in-feet"}
    assert "--height-unit ft" in str(scene.the("heights-in-feet"))


def write_town_of_new_york(path: Path, crs: str) -> Path:
    """Writes a town on a ground at 500 m, whose heights are in metres whatever the unit of the plane."""
    return write_citygml(path, crs, at(*NEW_YORK, crs), prefix=path.stem)


def write_plain(path: Path) -> Path:
    """Writes a flat elevation model at 500 m around New York."""
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:26918", always_xy=True).transform(*NEW_YORK)
    transform = rasters.from_bounds(x - 500, y - 500, x + 500, y + 500, 50, 50)
    return rasters.write(path, np.full((1, 50, 50), 500.0, dtype=np.float32), crs="EPSG:26918", transform=transform)


@pytest.mark.parametrize("is_terrain", [True, False])
def test_heights_in_metres_on_a_plane_in_feet_are_read_so_if_the_ground_says_it(tmp_path: Path, scene: Scene, is_terrain: bool) -> None:
    other = write_plain(tmp_path / "dem.tif") if is_terrain else write_town_of_new_york(tmp_path / "b.gml", "EPSG:26918")
    files = [other, write_town_of_new_york(tmp_path / "a.gml", "EPSG:2263")]
    scene.add(*files)
    assert scene.the("heights-read-in-metres").count == 16
    found = [box[0][2] for name, box in scene.boxes().items() if name.startswith("ahouse")]
    assert np.allclose(found, 500.0, atol=0.01)
    scene.add(*files, heights="0")
    found = scene.the("heights-in-metres" if is_terrain else "heights-in-metres-beside-file")
    assert "--height-unit m" in str(found)
    scene.add(*files, heights="auto", height_unit="m")
    assert not scene.codes() & {*CONTRADICTIONS, "heights-read-in-metres", "heights-in-metres-beside-file"}


def test_terrain_in_feet_is_named(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town()), write_dem(tmp_path / "dem.tif", factor=1 / 0.3048))
    assert scene.codes() & CONTRADICTIONS == {"terrain-in-feet"}


@pytest.mark.parametrize("with_terrain", [True, False])
def test_one_house_far_off_is_named_and_does_not_lower_the_ground(tmp_path: Path, scene: Scene, with_terrain: bool) -> None:
    houses = town()
    houses[5] = type(houses[5])(houses[5].name, houses[5].x, houses[5].y, houses[5].z - 520.0)
    scene.add(write_houses(tmp_path / "a.gml", houses), *([write_dem(tmp_path / "dem.tif")] if with_terrain else []))
    found = scene.the("objects-off-ground")
    assert (found.count, found.example.split(":")[0]) == (1, "b5")
    assert scene.codes() & CONTRADICTIONS == {"objects-off-ground"}
    if not with_terrain:
        scene.build()
        (ground,) = (box for name, box in scene.boxes().items() if name == "ground")
        assert ground[0][2] == pytest.approx(grounds().min(), abs=0.01)


def test_roads_without_heights_lie_on_the_terrain(tmp_path: Path, scene: Scene) -> None:
    roads = write_flat(tmp_path / "r.gml", "tran:Road", {"r": road(-20.0)})
    scene.add(write_houses(tmp_path / "a.gml", town()), roads, write_dem(tmp_path / "dem.tif"))
    assert scene.the("flat-objects-draped").count == 1
    (west, east) = scene.boxes()["r"]
    assert west[2] == pytest.approx(slope(EAST - 20.0, 0), abs=0.05)
    assert east[2] == pytest.approx(slope(EAST + 180.0, 0), abs=0.05)
    _, report = scene.build()
    assert report["adjusted_away"] == 2
    scene.add(roads, heights="as-is")
    assert scene.boxes()["r"][1][2] == 0.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_roads_without_heights_lie_between_the_houses_where_there_is_no_terrain(tmp_path: Path, scene: Scene, dimension: int) -> None:
    roads = write_flat(tmp_path / "r.gml", "tran:Road", {"r": road(0.0), "s": road(0.0)}, dimension=dimension)
    scene.add(write_houses(tmp_path / "a.gml", town()), roads)
    assert scene.the("flat-objects-draped").count == 2
    low, high = scene.boxes()["r"]
    assert grounds().min() - 1 <= low[2] <= high[2] <= grounds().max() + 1


def test_land_use_is_draped_on_request_and_houses_of_a_class_are_clamped(tmp_path: Path, scene: Scene) -> None:
    field = write_flat(tmp_path / "l.gml", "luse:LandUse", {"f": road(0.0, 300.0)})
    files = [write_houses(tmp_path / "a.gml", town(above=4.0)), field, write_dem(tmp_path / "dem.tif")]
    scene.add(*files)
    assert scene.the("heights-below-terrain").reason.values["class"] == "land_use"
    scene.add(*files, clamp=["land_use", "building"])
    assert {"objects-draped", "objects-clamped"} <= scene.codes()
    assert scene.boxes()["f"][0][2] == pytest.approx(slope(EAST, 0), abs=0.05)
    assert np.allclose(bases(scene), grounds(), atol=1.0)


def test_a_photo_without_elevation_lies_on_the_bases_of_the_houses(tmp_path: Path, scene: Scene) -> None:
    houses, photo = write_houses(tmp_path / "a.gml", town()), write_photo(tmp_path / "ortho.tif")
    scene.add(houses, photo)
    assert scene.the("photo-draped-on-bases").count == 1
    boxes = [box for name, box in scene.boxes().items() if name.startswith("ortho")]
    assert min(box[0][2] for box in boxes) == pytest.approx(grounds().min(), abs=1.0)
    assert max(box[1][2] for box in boxes) == pytest.approx(grounds().max(), abs=1.0)
    scene.add(houses, photo, unchanged=True)
    write_houses(tmp_path / "a.gml", town(above=30.0))
    scene.add(houses, photo, unchanged=True)
    boxes = [box for name, box in scene.boxes().items() if name.startswith("ortho")]
    assert min(box[0][2] for box in boxes) == pytest.approx(grounds().min() + 30.0, abs=1.0), "it follows the houses"


def test_a_photo_that_came_before_the_houses_is_named(tmp_path: Path, scene: Scene) -> None:
    photo = write_photo(tmp_path / "ortho.tif")
    scene.add(photo)
    scene.add(write_houses(tmp_path / "a.gml", town()))
    assert scene.the("photo-below-objects").count == 1
    scene.add(photo)
    assert "photo-below-objects" not in scene.codes()


def test_the_scene_states_no_height_system_that_a_part_of_it_contradicts(tmp_path: Path, scene: Scene) -> None:
    known = write_houses(tmp_path / "a.gml", town(), crs="EPSG:25832+7837")
    scene.add(known)
    assert scene.catalogue.scene("town").stated_crs.vertical == "DHHN2016 height"
    scene.add(write_dem(tmp_path / "dem.tif"))
    assert scene.catalogue.scene("town").stated_crs.vertical == "DHHN2016 height", "terrain that fits is of the same system"
    other = [type(house)(f"c{house.name}", house.x, house.y + 200.0, house.z) for house in town(above=46.5)]
    scene.add(write_houses(tmp_path / "c.gml", other))
    stated = scene.catalogue.scene("town").stated_crs
    assert (stated.vertical, stated.heights) == (None, "unknown")
    assert "DHHN2016" not in stated.wkt


@pytest.mark.parametrize("text", ["up", "1e9", "nan"])
def test_other_words_for_heights_are_refused(tmp_path: Path, scene: Scene, text: str) -> None:
    with pytest.raises(BadRequest, match="--heights"):
        scene.add(write_houses(tmp_path / "a.gml", town()), heights=text)


def test_removing_the_terrain_undoes_what_depended_on_it(tmp_path: Path, scene: Scene) -> None:
    from map3d.ingest.asset_removal import remove_assets

    roads = write_flat(tmp_path / "r.gml", "tran:Road", {"r": road(0.0)})
    scene.add(roads, write_dem(tmp_path / "dem.tif"))
    assert scene.boxes()["r"][0][2] > 500
    remove_assets(scene.workspace, scene.catalogue, "town", ["dem"])
    scene.build()
    assert scene.boxes()["r"][0][2] == 0.0
    assert "flat-objects-draped" not in scene.codes()


def test_places_are_metres_from_the_town(tmp_path: Path, scene: Scene) -> None:
    scene.add(write_houses(tmp_path / "a.gml", town()))
    assert scene.boxes()["b0"][0][:2] == pytest.approx((EAST, NORTH))
