"""Position of the sun over a place on earth, and the hours of a day."""

import math
from datetime import UTC, date, datetime, timedelta, timezone
from typing import Final, NamedTuple

from map3d.errors import BadRequest

HOURS: Final = range(5, 21)
"""Sixteen full hours of a day, in the place's zone time."""

PRESSURE_MBAR: Final = 1013.25
TEMPERATURE_C: Final = 15.0
"""Standard atmosphere at sea level; its refraction lifts a low sun by up to half a degree."""


class GeographicPosition(NamedTuple):
    """WGS 84, degrees, north and east positive."""

    latitude_deg: float
    longitude_deg: float

    def checked(self) -> "GeographicPosition":
        """Returns the position itself; raises BadRequest for one that does not exist."""
        if not (abs(self.latitude_deg) <= 90 and abs(self.longitude_deg) <= 180):
            raise BadRequest(
                f"place {self.latitude_deg:g}, {self.longitude_deg:g}: expected a latitude of -90 to 90 and a longitude of -180 to 180 degrees"
            )
        return self


class SunAngles(NamedTuple):
    """Azimuth clockwise from true north (0 ≤ a < 360), elevation above the horizon; degrees."""

    azimuth_deg: float
    elevation_deg: float


def sun_angles(place: GeographicPosition, time: datetime) -> SunAngles:
    """Returns the apparent position of the sun, with the refraction of the standard atmosphere. `time` has a zone."""
    import ephem

    observer = ephem.Observer()
    observer.lat, observer.lon = math.radians(place.latitude_deg), math.radians(place.longitude_deg)
    observer.elevation, observer.pressure, observer.temp = 0.0, PRESSURE_MBAR, TEMPERATURE_C
    observer.date = ephem.Date(time.astimezone(UTC).replace(tzinfo=None))
    sun = ephem.Sun(observer)
    return SunAngles(round(math.degrees(float(sun.az)), 6) % 360.0, round(math.degrees(float(sun.alt)), 6))


def hours_of(place: GeographicPosition, day: date) -> tuple[datetime, ...]:
    """Returns HOURS of a day in the zone of the longitude, a whole number of hours from UTC: the sun is highest near noon."""
    zone = timezone(timedelta(hours=math.floor(place.longitude_deg / 15.0 + 0.5)))
    return tuple(datetime(day.year, day.month, day.day, hour, tzinfo=zone) for hour in HOURS)


def time_text(time: datetime) -> str:
    """Formats a time in UTC to the second, e.g. 2026-06-21T13:00:00Z."""
    return time.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
