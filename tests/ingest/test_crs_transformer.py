"""From source to scene coordinates, against known points."""

import numpy as np
import pytest

from map3d.errors import CrsError
from map3d.ingest.asset_reprojector import Placing
from map3d.ingest.crs import horizontal, parse_crs
from map3d.ingest.crs_transformer import Projection, choose_target

MUNICH_UTM = (691_000.0, 5_336_000.0, 520.0)


def points(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(rows, dtype=np.float64)


@pytest.mark.parametrize("name", ["EPSG:25832", "EPSG:31468", "EPSG:3068", "EPSG:2180", "EPSG:28992"])
def test_the_same_system_leaves_every_bit(name: str) -> None:
    """Also where the authority puts the northing first: files have x = east."""
    given = points((4_468_503.123456789, 5_333_317.987654321, 1.1), (0.1, 0.2, -0.3))
    projection = Projection(parse_crs(name), parse_crs(name))
    assert np.array_equal(projection.world(given), given)
    assert projection.report["accuracy_m"] == 0.0


def test_geographic_coordinates_come_in_the_authoritys_order() -> None:
    latitude_first = Projection(parse_crs("EPSG:4258"), parse_crs("EPSG:25832")).world(points((48.0, 12.0, 5.0)))
    longitude_first = Projection(parse_crs("OGC:CRS84"), parse_crs("EPSG:32632")).world(points((12.0, 48.0, 5.0)))
    assert np.allclose(latitude_first, longitude_first, atol=0.001)
    assert 700_000 < latitude_first[0, 0] < 750_000
    assert 5_300_000 < latitude_first[0, 1] < 5_350_000
    assert latitude_first[0, 2] == 5.0


def test_gauss_kruger_to_utm_is_right_within_its_accuracy() -> None:
    """The towers of Munich's Frauenkirche, in DHDN / 3-degree Gauss-Krüger 4 and ETRS89 / UTM 32."""
    projection = Projection(parse_crs("urn:adv:crs:DE_DHDN_3GK4"), parse_crs("EPSG:25832"))
    back = Projection(parse_crs("EPSG:25832"), parse_crs("EPSG:31468"))
    world = projection.world(points((4_468_280.0, 5_333_500.0, 520.0)))
    assert 691_000 < world[0, 0] < 692_000
    assert 5_334_000 < world[0, 1] < 5_336_500
    assert np.allclose(back.world(world), [(4_468_280.0, 5_333_500.0, 520.0)], atol=0.01)
    assert projection.report["ballpark"] is False
    assert 0 < projection.report["accuracy_m"] <= 5


def test_heights_are_kept_where_no_grid_is_installed_and_that_is_said() -> None:
    projection = Projection(parse_crs("EPSG:2154+5720"), parse_crs("EPSG:2154+5621"))
    assert projection.world(points(MUNICH_UTM))[0].tolist() == list(MUNICH_UTM)
    assert "no grid" in projection.report["heights"]
    dutch = Projection(parse_crs("EPSG:7415"), parse_crs("EPSG:32631"))
    assert dutch.world(points((155_000.0, 463_000.0, 7.5)))[0, 2] == 7.5


def test_heights_are_transformed_where_that_can_be_done() -> None:
    projection = Projection(parse_crs("EPSG:25832+5783"), parse_crs("EPSG:25832+7837"))
    world = projection.world(points(MUNICH_UTM))[0]
    assert world[:2].tolist() == [691_000.0, 5_336_000.0]
    assert 0 < abs(world[2] - 520.0) < 0.1
    assert projection.report["heights"].startswith("transformed from DHHN92 height to DHHN2016 height")


def test_feet_become_metres() -> None:
    """NAD83 / New York Long Island (ftUS) with heights in US survey feet."""
    projection = Projection(parse_crs("EPSG:2263+6360"), parse_crs("EPSG:32618"))
    world = projection.world(points((984_000.0, 205_000.0, 100.0)))
    assert 580_000 < world[0, 0] < 590_000
    assert world[0, 2] == pytest.approx(30.48006, abs=1e-4)


def test_eastings_with_the_zone_in_front_lose_it_and_are_counted() -> None:
    projection = Projection(parse_crs("EPSG:25832"), parse_crs("EPSG:25832"))
    world = projection.world(points((32_691_000.0, 5_336_000.0, 0.0), (691_000.0, 5_336_000.0, 0.0)))
    assert world[:, 0].tolist() == [691_000.0, 691_000.0]
    assert projection.report["zone_prefixed_points"] == 1


def test_points_without_sense_become_infinite_and_raise_nothing() -> None:
    world = Projection(parse_crs("EPSG:4326"), parse_crs("EPSG:25832")).world(points((1e9, 1e9, 0.0), (48.0, 12.0, 0.0)))
    assert not np.isfinite(world[0]).all()
    assert np.isfinite(world[1]).all()


@pytest.mark.parametrize(
    ("source", "middle", "target"),
    [
        ("EPSG:25832", MUNICH_UTM, 25832),
        ("EPSG:4258", (48.1, 11.6, 0.0), 25832),
        ("EPSG:4326", (48.1, 11.6, 0.0), 32632),
        ("EPSG:6697", (35.28, 139.67, 0.0), 6691),
        ("EPSG:4326", (-33.9, 151.2, 0.0), 32756),
        ("EPSG:2263", (984_000.0, 205_000.0, 0.0), 26918),
    ],
)
def test_a_scene_without_system_takes_a_projected_one_in_metres(source: str, middle: tuple[float, float, float], target: int) -> None:
    assert horizontal(choose_target(parse_crs(source), points(middle))).to_epsg() == target


def test_no_zone_is_said() -> None:
    with pytest.raises(CrsError, match="--crs"):
        choose_target(parse_crs("EPSG:4326"), points((np.nan, np.nan, 0.0)))
    with pytest.raises(CrsError, match="--crs"):
        choose_target(parse_crs("EPSG:4326"), points((89.0, 0.0, 0.0)))


def test_placements_turn_with_north() -> None:
    """A prototype's y axis points at the source's north; in the scene it must point at the same place on the ground."""
    source, target = parse_crs("EPSG:31468"), parse_crs("EPSG:25832")
    projection = Projection(source, target)
    at = (4_468_280.0, 5_333_500.0, 520.0)
    transform = np.array([[2.0, 0, 0, at[0], 0, 2.0, 0, at[1], 0, 0, 2.0, at[2]]])
    matrix = projection.world_transforms(transform).reshape(3, 4)
    moved = matrix[:, :3] @ np.array([0.0, 10.0, 0.0]) + matrix[:, 3]
    exact = projection.world(points((at[0], at[1] + 20.0, at[2])))[0]
    assert np.allclose(moved, exact, atol=0.02)
    assert np.allclose(np.linalg.det(matrix[:, :3]), 8.0)


def test_placements_in_the_same_system_keep_their_turn() -> None:
    transforms = np.arange(24, dtype=np.float64).reshape(2, 12)
    assert np.array_equal(Projection(parse_crs("EPSG:25832"), parse_crs("EPSG:25832")).world_transforms(transforms), transforms)
    assert Placing("obj", None, None).world_transforms(np.zeros((0, 12))).shape == (0, 12)


def test_files_without_a_system() -> None:
    given = points((1.0, 2.0, 3.0))
    local = Placing("obj", None, None)
    assert np.array_equal(local.world(given), given)
    assert local.proposed is not None
    assert local.proposed.is_local
    assert Placing("obj", None, "EPSG:25832").world(given) is given
    assert Placing("citygml", "local", None).world(given) is given
    with pytest.raises(CrsError, match="--crs local"):
        Placing("citygml", None, None).world(given)
    with pytest.raises(CrsError, match="--crs local"):
        Placing("citygml", None, "EPSG:25832").world(given)
    with pytest.raises(CrsError, match="another scene"):
        Placing("citygml", "EPSG:25832", "local")


def test_the_first_asset_names_the_scenes_heights() -> None:
    placing = Placing("citygml", "urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", None)
    placing.world(points(MUNICH_UTM))
    assert placing.proposed is not None
    assert placing.proposed.vertical == "DHHN2016 height"
    japan = Placing("citygml", "EPSG:6697", None)
    japan.world(points((35.28, 139.67, 12.0)))
    assert japan.proposed is not None
    assert (japan.proposed.epsg, japan.proposed.vertical) == (6691, "JGD2011 (vertical) height")
