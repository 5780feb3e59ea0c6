"""Where the sun stands over a place on earth, and the hours of a day that are worth looking at."""

import math
from datetime import UTC, date, datetime, timedelta, timezone
from typing import Final, NamedTuple

from map3d.errors import BadRequest

HOURS: Final = range(5, 21)
"""Of a day, in the place's zone time: sixteen full hours."""

PRESSURE_MBAR: Final = 1013.25
TEMPERATURE_C: Final = 15.0
"""Of the standard atmosphere at sea level, which lifts a low sun by up to half a degree."""


class Place(NamedTuple):
    """WGS 84, degrees, north and east positive. Raises BadRequest where `checked`."""

    latitude_deg: float
    longitude_deg: float

    def checked(self) -> "Place":
        if not (abs(self.latitude_deg) <= 90 and abs(self.longitude_deg) <= 180):
            raise BadRequest(f"place {self.latitude_deg:g}, {self.longitude_deg:g}: latitudes go from -90 to 90, longitudes from -180 to 180 degrees")
        return self


class SunAngles(NamedTuple):
    """Azimuth clockwise from true north (0 ≤ a < 360), elevation above the horizon; degrees."""

    azimuth_deg: float
    elevation_deg: float


def sun_angles(place: Place, time: datetime) -> SunAngles:
    """As one sees the sun there, through the standard atmosphere: from there its light comes. `time` has a zone."""
    import ephem

    observer = ephem.Observer()
    observer.lat, observer.lon = math.radians(place.latitude_deg), math.radians(place.longitude_deg)
    observer.elevation, observer.pressure, observer.temp = 0.0, PRESSURE_MBAR, TEMPERATURE_C
    observer.date = ephem.Date(time.astimezone(UTC).replace(tzinfo=None))
    sun = ephem.Sun(observer)
    return SunAngles(round(math.degrees(float(sun.az)), 6) % 360.0, round(math.degrees(float(sun.alt)), 6))


def hours_of(place: Place, day: date) -> tuple[datetime, ...]:
    """HOURS of a day in the zone that the longitude has: whole hours from UTC, so that the sun is near its highest at noon."""
    zone = timezone(timedelta(hours=math.floor(place.longitude_deg / 15.0 + 0.5)))
    return tuple(datetime(day.year, day.month, day.day, hour, tzinfo=zone) for hour in HOURS)


def time_text(time: datetime) -> str:
    """UTC to the second, e.g. 2026-06-21T13:00:00Z."""
    return time.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
