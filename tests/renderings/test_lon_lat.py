"""Polynomials for longitude and latitude, compared with PROJ."""

import math

import numpy as np
import pytest
from pyproj import CRS, Geod, Transformer

from map3d.catalogue import SceneRecord
from map3d.catalogue.records import LOCAL_CRS_NAME, SceneCrs
from map3d.renderings.lon_lat import geographic_of
from map3d.tiles.manifest import Geographic

PLACES = {
    "UTM, a district": (25832, (691_000.0, 5_336_000.0, 500.0), 400.0),
    "UTM, a city": (25832, (691_000.0, 5_336_000.0, 500.0), 20_000.0),
    "Gauss-Krüger": (31467, (3_513_000.0, 5_404_000.0, 0.0), 5_000.0),
    "Swiss": (2056, (2_600_000.0, 1_200_000.0, 0.0), 8_000.0),
    "Krovak, axes south and west": (5513, (1_043_000.0, 743_000.0, 0.0), 3_000.0),
    "Web Mercator": (3857, (-8_238_000.0, 4_970_000.0, 0.0), 12_000.0),
    "across the antimeridian": (3832, (3_339_584.0, -1_900_000.0, 0.0), 6_000.0),
    "south": (32756, (334_000.0, 6_252_000.0, 0.0), 10_000.0),
}


def terms(p, q, degree):
    return [p ** (total - k) * q**k for total in range(degree + 1) for k in range(total + 1)]


def value(coefficients, p, q, degree):
    return sum(c * t for c, t in zip(coefficients, terms(p, q, degree), strict=True))


def lon_lat(g: Geographic, x: float, y: float) -> tuple[float, float]:
    """Evaluates the polynomials as in spec/manifest.md."""
    p, q = ((v - c) / g.unit_m for v, c in zip((x, y), g.local, strict=True))
    lon, lat = (c + value(row, p, q, g.degree) for c, row in zip(g.lon_lat, g.to, strict=True))
    return lon, lat


def local(g: Geographic, lon: float, lat: float) -> tuple[float, float]:
    p, q = ((v - c) / g.unit_deg for v, c in zip((lon, lat), g.lon_lat, strict=True))
    x, y = (c + value(row, p, q, g.degree) for c, row in zip(g.local, g.back, strict=True))
    return x, y


def scene(code: int, origin) -> SceneRecord:
    crs = CRS.from_epsg(code)
    return SceneRecord("town", crs=SceneCrs(code, crs.to_wkt(), crs.name), origin=origin)


@pytest.mark.parametrize("name", PLACES)
def test_polynomials_equal_proj_within_a_millimetre(name):
    code, origin, half_m = PLACES[name]
    box = ((-half_m, -0.7 * half_m, 0.0), (half_m, 0.9 * half_m, 80.0))
    geographic = geographic_of(scene(code, origin), box)
    assert geographic is not None
    assert geographic.error_m < 0.001
    to_degrees, earth = Transformer.from_crs(code, 4326, always_xy=True), Geod(ellps="WGS84")
    for x, y in np.random.default_rng(7).uniform(-half_m, half_m, (200, 2)):
        there = lon_lat(geographic, x, y)
        expected = to_degrees.transform(origin[0] + x, origin[1] + y)
        assert earth.inv(*there, *expected)[2] < 0.001
        near = expected[0] + 360 * round((there[0] - expected[0]) / 360)
        assert math.dist(local(geographic, near, expected[1]), (x, y)) < 0.001


def test_local_scene_has_no_longitude_and_latitude():
    box = ((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))
    assert geographic_of(SceneRecord("pot", crs=SceneCrs(None, None, LOCAL_CRS_NAME), origin=(0.0, 0.0, 0.0)), box) is None
    assert geographic_of(SceneRecord("empty"), box) is None


def test_position_outside_the_coordinate_system_has_no_longitude_and_latitude():
    assert geographic_of(scene(25832, (1e12, 1e12, 0.0)), ((-1.0, -1.0, 0.0), (1.0, 1.0, 1.0))) is None
