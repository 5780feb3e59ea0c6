"""The geoid is where published models have it, within the stated accuracy."""

import pytest

from map3d.geometry.geoid import ACCURACY_M, geoid_above_ellipsoid_m


@pytest.mark.parametrize(
    ("lon", "lat", "undulation_m"),
    [
        (11.57, 48.14, 46.0),
        (139.7, 35.7, 36.7),
        (-74.0, 40.7, -32.8),
        (21.0, 52.2, 31.3),
        (77.2, 28.6, -53.0),
        (79.9, 6.9, -98.0),
        (151.2, -33.9, 22.4),
        (-118.2, 34.0, -36.0),
        (-3.7, 40.4, 51.5),
        (-21.9, 64.1, 66.0),
        (-46.6, -23.5, -3.7),
    ],
)
def test_the_geoid_is_as_far_from_the_ellipsoid_as_models_say(lon: float, lat: float, undulation_m: float) -> None:
    assert abs(geoid_above_ellipsoid_m(lon, lat) - undulation_m) < ACCURACY_M


def test_it_is_the_same_after_a_turn_around_the_earth() -> None:
    assert geoid_above_ellipsoid_m(371.0, 48.0) == pytest.approx(geoid_above_ellipsoid_m(11.0, 48.0))
