"""Transformation from source to scene coordinates, against known points."""

import numpy as np
import pytest

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.ingest.asset_reprojector import AssetReprojector
from map3d.ingest.crs_transformer import CrsTransformer
from map3d.ingest.scene_crs import choose_scene_crs

MUNICH_UTM = (691_000.0, 5_336_000.0, 520.0)


def points(*rows: tuple[float, float, float]) -> np.ndarray:
    return np.array(rows, dtype=np.float64)


@pytest.mark.parametrize("name", ["EPSG:25832", "EPSG:31468", "EPSG:3068", "EPSG:2180", "EPSG:28992"])
def test_coordinates_in_the_same_crs_stay_bit_exact(name: str) -> None:
    """Also where the authority's axis order has the northing first: files write x = east."""
    given = points((4_468_503.123456789, 5_333_317.987654321, 1.1), (0.1, 0.2, -0.3))
    transformer = CrsTransformer(parse_crs(name), parse_crs(name))
    assert np.array_equal(transformer.to_world(given), given)
    assert transformer.report["accuracy_m"] == 0.0


def test_geographic_coordinates_follow_the_authoritys_axis_order() -> None:
    latitude_first = CrsTransformer(parse_crs("EPSG:4258"), parse_crs("EPSG:25832")).to_world(points((48.0, 12.0, 5.0)))
    longitude_first = CrsTransformer(parse_crs("OGC:CRS84"), parse_crs("EPSG:32632")).to_world(points((12.0, 48.0, 5.0)))
    assert np.allclose(latitude_first, longitude_first, atol=0.001)
    assert 700_000 < latitude_first[0, 0] < 750_000
    assert 5_300_000 < latitude_first[0, 1] < 5_350_000
    assert latitude_first[0, 2] == 5.0


def test_gauss_kruger_to_utm_is_within_its_stated_accuracy() -> None:
    """The towers of Munich's Frauenkirche, in DHDN / 3-degree Gauss-Krüger 4 and ETRS89 / UTM 32."""
    transformer = CrsTransformer(parse_crs("urn:adv:crs:DE_DHDN_3GK4"), parse_crs("EPSG:25832"))
    back = CrsTransformer(parse_crs("EPSG:25832"), parse_crs("EPSG:31468"))
    world = transformer.to_world(points((4_468_280.0, 5_333_500.0, 520.0)))
    assert 691_000 < world[0, 0] < 692_000
    assert 5_334_000 < world[0, 1] < 5_336_500
    assert np.allclose(back.to_world(world), [(4_468_280.0, 5_333_500.0, 520.0)], atol=0.01)
    assert transformer.report["ballpark"] is False
    assert 0 < transformer.report["accuracy_m"] <= 5


def test_heights_stay_unchanged_without_a_grid_and_the_report_says_so() -> None:
    transformer = CrsTransformer(parse_crs("EPSG:2154+5720"), parse_crs("EPSG:2154+5621"))
    assert transformer.to_world(points(MUNICH_UTM))[0].tolist() == list(MUNICH_UTM)
    assert "no grid" in transformer.report["heights"]
    dutch = CrsTransformer(parse_crs("EPSG:7415"), parse_crs("EPSG:32631"))
    assert dutch.to_world(points((155_000.0, 463_000.0, 7.5)))[0, 2] == 7.5


def test_heights_are_transformed_if_proj_can() -> None:
    transformer = CrsTransformer(parse_crs("EPSG:25832+5783"), parse_crs("EPSG:25832+7837"))
    world = transformer.to_world(points(MUNICH_UTM))[0]
    assert world[:2].tolist() == [691_000.0, 5_336_000.0]
    assert 0 < abs(world[2] - 520.0) < 0.1
    assert transformer.report["heights"].startswith("transformed from DHHN92 height to DHHN2016 height")


def test_feet_become_metres() -> None:
    """NAD83 / New York Long Island (ftUS) with heights in US survey feet."""
    transformer = CrsTransformer(parse_crs("EPSG:2263+6360"), parse_crs("EPSG:32618"))
    world = transformer.to_world(points((984_000.0, 205_000.0, 100.0)))
    assert 580_000 < world[0, 0] < 590_000
    assert world[0, 2] == pytest.approx(30.48006, abs=1e-4)


def test_zone_prefixes_are_removed_from_eastings_and_counted() -> None:
    transformer = CrsTransformer(parse_crs("EPSG:25832"), parse_crs("EPSG:25832"))
    world = transformer.to_world(points((32_691_000.0, 5_336_000.0, 0.0), (691_000.0, 5_336_000.0, 0.0)))
    assert world[:, 0].tolist() == [691_000.0, 691_000.0]
    assert transformer.report["zone_prefixed_points"] == 1


def test_invalid_points_become_infinite_without_an_error() -> None:
    world = CrsTransformer(parse_crs("EPSG:4326"), parse_crs("EPSG:25832")).to_world(points((1e9, 1e9, 0.0), (48.0, 12.0, 0.0)))
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
def test_a_scene_without_crs_gets_a_projected_one_in_metres(source: str, middle: tuple[float, float, float], target: int) -> None:
    assert horizontal_crs(choose_scene_crs(parse_crs(source), points(middle))).to_epsg() == target


def test_points_outside_all_utm_zones_raise_crs_error() -> None:
    with pytest.raises(CrsError, match="--crs"):
        choose_scene_crs(parse_crs("EPSG:4326"), points((np.nan, np.nan, 0.0)))
    with pytest.raises(CrsError, match="--crs"):
        choose_scene_crs(parse_crs("EPSG:4326"), points((89.0, 0.0, 0.0)))


def test_instances_rotate_with_north() -> None:
    """A prototype's y axis points to the source's north; in the scene it must point to the same location."""
    source, target = parse_crs("EPSG:31468"), parse_crs("EPSG:25832")
    transformer = CrsTransformer(source, target)
    at = (4_468_280.0, 5_333_500.0, 520.0)
    transform = np.array([[2.0, 0, 0, at[0], 0, 2.0, 0, at[1], 0, 0, 2.0, at[2]]])
    matrix = transformer.transforms_to_world(transform).reshape(3, 4)
    moved = matrix[:, :3] @ np.array([0.0, 10.0, 0.0]) + matrix[:, 3]
    exact = transformer.to_world(points((at[0], at[1] + 20.0, at[2])))[0]
    assert np.allclose(moved, exact, atol=0.02)
    assert np.allclose(np.linalg.det(matrix[:, :3]), 8.0)


def test_instances_in_the_same_crs_keep_their_rotation() -> None:
    transforms = np.arange(24, dtype=np.float64).reshape(2, 12)
    assert np.array_equal(CrsTransformer(parse_crs("EPSG:25832"), parse_crs("EPSG:25832")).transforms_to_world(transforms), transforms)
    assert AssetReprojector("obj", None, None).transforms_to_world(np.zeros((0, 12))).shape == (0, 12)


def test_files_without_a_crs() -> None:
    given = points((1.0, 2.0, 3.0))
    local = AssetReprojector("obj", None, None)
    assert np.array_equal(local.to_world(given), given)
    assert local.proposed_crs is not None
    assert local.proposed_crs.is_local
    assert AssetReprojector("obj", None, "EPSG:25832").to_world(given) is given
    assert AssetReprojector("citygml", "local", None).to_world(given) is given
    with pytest.raises(CrsError, match="--crs local"):
        AssetReprojector("citygml", None, None).to_world(given)
    with pytest.raises(CrsError, match="--crs local"):
        AssetReprojector("citygml", None, "EPSG:25832").to_world(given)
    with pytest.raises(CrsError, match="another scene"):
        AssetReprojector("citygml", "EPSG:25832", "local")


def test_the_first_asset_determines_the_vertical_crs_of_the_scene() -> None:
    reprojector = AssetReprojector("citygml", "urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", None)
    reprojector.to_world(points(MUNICH_UTM))
    assert reprojector.proposed_crs is not None
    assert reprojector.proposed_crs.vertical == "DHHN2016 height"
    japan = AssetReprojector("citygml", "EPSG:6697", None)
    japan.to_world(points((35.28, 139.67, 12.0)))
    assert japan.proposed_crs is not None
    assert (japan.proposed_crs.epsg, japan.proposed_crs.vertical) == (6691, "JGD2011 (vertical) height")
