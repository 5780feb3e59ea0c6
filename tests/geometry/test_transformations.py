"""How positions get from one datum to another, with the grids that come with PROJ."""

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from pyproj import CRS, Geod
from pyproj.transformer import TransformerGroup

from map3d.errors import CrsError
from map3d.geometry.crs import parse_crs
from map3d.geometry.transformations import find_transformation

LONDON, TOKYO, NEW_YORK, MUNICH = (-0.12, 51.5), (139.7, 35.68), (-73.98, 40.75), (11.57, 48.14)


def lon_lat(source: str, x: float, y: float, place: tuple[float, float], target: str = "EPSG:4258") -> tuple[float, float]:
    east, north = find_transformation(parse_crs(source), parse_crs(target), place)(np.array([x]), np.array([y]))
    return float(east[0]), float(north[0])


def test_london_lies_where_the_ordnance_survey_says() -> None:
    """The origin of Big Ben's clock tower: TQ 30258 79606, published as 51.50070° N, 0.12454° W in ETRS89."""
    found = lon_lat("EPSG:27700", 530_268.0, 179_640.0, LONDON)
    assert Geod(ellps="GRS80").inv(*found, -0.12454, 51.50070)[2] < 15.0
    via = find_transformation(parse_crs("EPSG:27700"), parse_crs("EPSG:25830"), LONDON)
    assert "ballpark" not in via.description.lower()
    assert via.accuracy_m is not None
    assert 1.0 <= via.accuracy_m <= 5.0
    assert via.report["missing_grids"]


@pytest.mark.parametrize(
    ("source", "target", "place"),
    [
        ("EPSG:27700", "EPSG:25830", LONDON),
        ("EPSG:30169", "EPSG:6677", TOKYO),
        ("EPSG:26718", "EPSG:26918", NEW_YORK),
        ("EPSG:26718", "EPSG:32618", NEW_YORK),
        ("EPSG:31468", "EPSG:25832", MUNICH),
    ],
)
def test_no_transformation_between_datums_is_a_ballpark_one(source: str, target: str, place: tuple[float, float]) -> None:
    found = find_transformation(parse_crs(source), parse_crs(target), place)
    assert found.steps
    assert not found.inexact
    assert "ballpark" not in found.description.lower()
    assert found.accuracy_m is not None
    assert found.better is not None
    assert found.grids[0].endswith((".tif", ".gsb"))


def test_a_missing_grid_is_named_in_the_refusal() -> None:
    """The adjustment of NAD27 in Quebec is known by grids alone."""
    with pytest.raises(CrsError, match=r"from NAD27\(CGQ77\) .* is possible without the grid ca_que_\w+\.tif; install it with projsync"):
        find_transformation(parse_crs("EPSG:4609"), parse_crs("EPSG:32618"))


def test_modern_datums_are_the_same_within_metres() -> None:
    """PROJ knows no transformation between China's and WGS 84."""
    found = find_transformation(parse_crs("EPSG:4490"), parse_crs("EPSG:32650"))
    assert (found.inexact, found.accuracy_m, len(found.steps)) == (False, None, 1)


def test_a_datum_without_a_name_is_taken_for_the_other_one_and_said() -> None:
    nameless = CRS("+proj=utm +zone=32 +ellps=GRS80 +units=m +no_defs")
    found = find_transformation(nameless, parse_crs("EPSG:25832"))
    assert (found.inexact, found.accuracy_m) == (True, None)
    assert find_transformation(parse_crs("EPSG:25832"), parse_crs("EPSG:25832")).steps == ()


def test_parameters_of_the_datum_that_a_file_states_count() -> None:
    stated = CRS("+proj=tmerc +lat_0=0 +lon_0=12 +k=1 +x_0=4500000 +ellps=bessel +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7 +units=m +type=crs")
    east, north = find_transformation(stated, parse_crs("EPSG:25832"))(np.array([4_468_280.0]), np.array([5_333_500.0]))
    wanted = find_transformation(parse_crs("EPSG:31468"), parse_crs("EPSG:25832"), MUNICH)(np.array([4_468_280.0]), np.array([5_333_500.0]))
    assert np.hypot(east - wanted[0], north - wanted[1])[0] < 3.0


@pytest.mark.parametrize(("source", "target"), [("EPSG:31468", "EPSG:25832"), ("EPSG:4326", "EPSG:32632"), ("EPSG:25833", "EPSG:25832")])
def test_transformations_are_those_of_proj_and_work_in_threads(source: str, target: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        group = TransformerGroup(source, target, always_xy=True, allow_ballpark=False)
    x, y = np.array([11.5, 11.6, 12.0]), np.array([48.1, 48.2, 48.3])
    if source != "EPSG:4326":
        x, y = find_transformation(parse_crs("EPSG:4258"), parse_crs(source))(x, y)
    found = find_transformation(parse_crs(source), parse_crs(target))
    with ThreadPoolExecutor(2) as pool:
        for done in pool.map(lambda _: found(x, y), range(4)):
            assert np.array_equal(np.array(done), np.array(group.transformers[0].transform(x, y)))


def test_the_transformation_for_the_place_is_chosen() -> None:
    """NAD27 in Alaska and in New York."""
    alaska = find_transformation(parse_crs("EPSG:26706"), parse_crs("EPSG:32606"), (-149.9, 61.2))
    assert "Alaska" in alaska.description or alaska.accuracy_m is not None
    area = alaska.description
    assert area != find_transformation(parse_crs("EPSG:26718"), parse_crs("EPSG:32618"), NEW_YORK).description
