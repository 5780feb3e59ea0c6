"""Positions of the sun, compared with published values and the Astronomical Almanac's formula."""

import itertools
import math
from datetime import UTC, date, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from map3d.errors import BadRequest
from map3d.geometry.sun import GeographicPosition, SunAngles, hours_of, sun_angles, time_text

GREENWICH = GeographicPosition(51.4779, 0.0)


def vector(angles: SunAngles) -> np.ndarray:
    """East, north, up."""
    a, e = np.radians(angles)
    return np.array([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), np.sin(e)])


def apart_deg(one: SunAngles, other: SunAngles) -> float:
    return math.degrees(math.acos(min(1.0, float(vector(one) @ vector(other)))))


def lifted_deg(elevation_deg: float) -> float:
    """Bennett's refraction for the standard atmosphere, of a true elevation (Saemundsson's form)."""
    return 1.02 / 60 / math.tan(math.radians(elevation_deg + 10.3 / (elevation_deg + 5.11)))


def almanac(place: GeographicPosition, time: datetime) -> SunAngles:
    """Low-precision formula of the Astronomical Almanac (page C5): 0.01° between 1950 and 2050; without refraction."""
    days = (time - datetime(2000, 1, 1, 12, tzinfo=UTC)) / timedelta(days=1)
    mean_deg, anomaly = 280.460 + 0.9856474 * days, math.radians(357.528 + 0.9856003 * days)
    longitude = math.radians(mean_deg + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2 * anomaly))
    tilt = math.radians(23.439 - 0.0000004 * days)
    ascension = math.atan2(math.cos(tilt) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(tilt) * math.sin(longitude))
    sidereal_h = 18.697374558 + 24.06570982441908 * days
    hour = math.radians(15 * sidereal_h + place.longitude_deg) - ascension
    latitude = math.radians(place.latitude_deg)
    east = -math.cos(declination) * math.sin(hour)
    north = math.sin(declination) * math.cos(latitude) - math.cos(declination) * math.cos(hour) * math.sin(latitude)
    up = math.sin(declination) * math.sin(latitude) + math.cos(declination) * math.cos(hour) * math.cos(latitude)
    return SunAngles(math.degrees(math.atan2(east, north)) % 360, math.degrees(math.asin(up)))


def test_the_example_of_the_solar_position_algorithm() -> None:
    """Reda and Andreas, NREL/TP-560-34302, table A5.1: azimuth 194.34024°, zenith 50.11162° at 820 mbar and 11 °C."""
    found = sun_angles(GeographicPosition(39.742476, -105.1786), datetime(2003, 10, 17, 12, 30, 30, tzinfo=timezone(timedelta(hours=-7))))
    assert found.azimuth_deg == pytest.approx(194.34024, abs=1e-3)
    assert found.elevation_deg == pytest.approx(90 - 50.11162, abs=5e-3)


@settings(max_examples=300, deadline=None)
@given(
    st.floats(-89, 89),
    st.floats(-180, 180),
    st.datetimes(datetime(1960, 1, 1), datetime(2045, 1, 1), timezones=st.just(UTC)),
)
def test_the_sun_matches_the_almanac_anywhere_at_any_time(latitude_deg: float, longitude_deg: float, time: datetime) -> None:
    place, time = GeographicPosition(latitude_deg, longitude_deg), time.replace(microsecond=0)
    expected = almanac(place, time)
    if expected.elevation_deg > 3:
        lifted = SunAngles(expected.azimuth_deg, expected.elevation_deg + lifted_deg(expected.elevation_deg))
        assert apart_deg(sun_angles(place, time), lifted) < 0.03
    elif expected.elevation_deg < -2:
        assert sun_angles(place, time).elevation_deg < 0


@pytest.mark.parametrize(
    ("time", "latitude_deg"),
    [("2024-06-20T20:51Z", 23.436), ("2024-12-21T09:20Z", -23.436), ("2024-03-20T03:06Z", 0.0), ("2024-09-22T12:44Z", 0.0)],
)
def test_at_solstices_and_equinoxes_the_sun_is_over_tropics_and_equator(time: str, latitude_deg: float) -> None:
    """Times as published for the year 2024, to the minute."""
    moment = datetime.fromisoformat(time)
    highest = max(sun_angles(GeographicPosition(latitude_deg, lon / 4), moment).elevation_deg for lon in range(-720, 720))
    assert highest > 89.87, "a longitude within an eighth of a degree, on the parallel to 0.02°"


@pytest.mark.parametrize(("day", "minutes"), [((2024, 2, 11), -14.2), ((2024, 5, 14), 3.65), ((2024, 7, 26), -6.5), ((2024, 11, 3), 16.45)])
def test_noon_differs_from_the_clocks_by_the_equation_of_time(day: tuple[int, int, int], minutes: float) -> None:
    """The four extremes of the equation of time, as published (minutes that the sun is ahead)."""
    noon = datetime(*day, 12, tzinfo=UTC) - timedelta(minutes=minutes)
    assert sun_angles(GREENWICH, noon).azimuth_deg == pytest.approx(180.0, abs=0.05)


def test_refraction_lifts_a_low_sun() -> None:
    """At the published minute of sunrise its upper edge, 16' above its middle, touches the horizon; without air that middle is 50' below it."""
    sunrise = datetime(2024, 3, 20, 6, 2, tzinfo=UTC)
    assert sun_angles(GREENWICH, sunrise).elevation_deg == pytest.approx(-16 / 60, abs=0.1)
    assert almanac(GREENWICH, sunrise).elevation_deg == pytest.approx(-50 / 60, abs=0.1)


def test_the_same_moment_in_any_zone_is_the_same() -> None:
    there = datetime(2026, 6, 21, 15, tzinfo=timezone(timedelta(hours=2)))
    assert sun_angles(GREENWICH, there) == sun_angles(GREENWICH, datetime(2026, 6, 21, 13, tzinfo=UTC))
    assert time_text(there) == "2026-06-21T13:00:00Z"


@pytest.mark.parametrize(
    ("longitude_deg", "offset_h"), [(0.0, 0), (7.4, 0), (7.5, 1), (11.4, 1), (-7.6, -1), (-122.4, -8), (151.2, 10), (180.0, 12), (-180.0, -12)]
)
def test_a_day_has_sixteen_full_hours_of_the_longitudes_own_zone(longitude_deg: float, offset_h: int) -> None:
    hours = hours_of(GeographicPosition(10.0, longitude_deg), date(2026, 6, 21))
    assert len(hours) == 16
    assert hours[0].astimezone(UTC) == datetime(2026, 6, 21, 5, tzinfo=UTC) - timedelta(hours=offset_h)
    assert [after - before for before, after in itertools.pairwise(hours)] == [timedelta(hours=1)] * 15
    assert max(hours, key=lambda time: sun_angles(GeographicPosition(40.0, longitude_deg), time).elevation_deg).hour in (12, 13)


@pytest.mark.parametrize("place", [(91, 0), (0, 181), (-90.5, 0), (0, -999), (math.nan, 0)])
def test_places_that_do_not_exist_are_refused(place: tuple[float, float]) -> None:
    with pytest.raises(BadRequest, match="place"):
        GeographicPosition(*place).checked()
