"""CRSs that a scene accepts."""

import numpy as np
import pytest
from pyproj import Transformer

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.ingest.scene_crs import choose_scene_crs, length_error, parse_scene_crs, to_scene_crs


def test_a_scene_needs_projected_metres() -> None:
    found = to_scene_crs(parse_crs("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH"))
    assert (found.epsg, found.name, found.vertical) == (25832, "ETRS89 / UTM zone 32N", "DHHN2016 height")
    assert found.wkt is not None
    assert not found.is_local
    for name in ("EPSG:4326", "EPSG:4979", "EPSG:2263"):
        with pytest.raises(CrsError, match="projected CRS in metres"):
            to_scene_crs(parse_crs(name))


def test_a_scene_crs_reads_back_from_its_wkt() -> None:
    first = to_scene_crs(parse_crs("EPSG:25832+7837"))
    assert first.wkt is not None
    assert to_scene_crs(parse_crs(first.wkt)) == first


@pytest.mark.parametrize(
    ("name", "lon", "lat", "error"),
    [
        ("EPSG:3857", 11.5755, 48.1374, 0.4984),
        ("EPSG:3395", 11.5755, 48.1374, 0.4954),
        ("EPSG:25832", 9.0, 48.0, -0.0004),
        ("EPSG:25832", 13.43, 48.57, 0.0009),
        ("EPSG:31468", 12.0, 48.0, 0.0),
        ("EPSG:27700", -0.12, 51.5, -0.0002),
        ("EPSG:2263", -73.98, 40.75, 0.0),
    ],
)
def test_errors_of_lengths_are_those_of_the_projection(name: str, lon: float, lat: float, error: float) -> None:
    assert length_error(parse_crs(name), lon, lat) == pytest.approx(error, abs=3e-3 if error > 0.1 else 1e-4)


@pytest.mark.parametrize(
    ("name", "lon", "lat", "chosen"),
    [
        ("EPSG:3857", 11.5755, 48.1374, 32632),
        ("EPSG:3395", -73.98, 40.75, 32618),
        ("EPSG:3035", -9.1, 38.7, 25829),
        ("EPSG:3035", 11.5755, 48.1374, 3035),
        ("EPSG:25832", 13.43, 48.57, 25832),
        ("EPSG:31467", 9.0, 48.5, 31467),
        ("EPSG:2154", 2.35, 48.85, 2154),
        ("EPSG:28992", 5.4, 52.2, 28992),
        ("EPSG:2180", 23.9, 52.0, 2180),
        ("EPSG:6677", 139.7, 35.7, 6677),
        ("EPSG:2056", 8.5, 47.4, 2056),
    ],
)
def test_a_scene_is_in_metres_of_its_place(name: str, lon: float, lat: float, chosen: int) -> None:
    x, y = Transformer.from_crs("EPSG:4326", name, always_xy=True).transform(lon, lat)
    assert horizontal_crs(choose_scene_crs(parse_crs(name), np.array([[x, y, 0.0]]))).to_epsg() == chosen


def test_strays_do_not_choose_the_zone() -> None:
    town = np.random.default_rng(1).normal([48.1, 11.6, 500.0], [0.01, 0.01, 5.0], (500, 3))
    for stray in ([0.0, 0.0, 0.0], [87.0, 87.0, 0.0], [500.0, 500.0, 0.0], [5e6, 6e5, 0.0], [np.nan, 0.0, 0.0]):
        assert choose_scene_crs(parse_crs("EPSG:4326"), np.vstack([[stray], town])).to_epsg() == 32632
    first = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]])
    assert choose_scene_crs(parse_crs("EPSG:4326"), first, np.array([48.1, 11.6])).to_epsg() == 32632, "the first polygon is a stray"


@pytest.mark.parametrize("name", ["EPSG:3857", "EPSG:3395", "EPSG:4087", "ESRI:102100"])
def test_maps_of_the_whole_earth_are_no_scenes(name: str) -> None:
    with pytest.raises(CrsError, match="whole Earth"):
        parse_scene_crs(name)
