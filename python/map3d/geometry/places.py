"""Says where on Earth a position is: near which large town."""

import math
from dataclasses import dataclass
from typing import Final

from map3d.geometry.towns import Town, towns
from map3d.messages import Message, message

EARTH_RADIUS_KM: Final = 6371.0
NEAR_KM: Final = 100.0


@dataclass(frozen=True)
class Place:
    """A position in degrees, WGS 84, and the nearest large town."""

    lon: float
    lat: float
    town: Town
    distance_km: float

    def __str__(self) -> str:
        """Returns e.g. "near Munich, Germany (48.137° N, 11.575° E)"; farther away the distance."""
        return str(self.message)

    @property
    def message(self) -> Message:
        town = f"{self.town.name}, {self.town.country}" if self.town.name != self.town.country else self.town.name
        lat = message("south" if self.lat < 0 else "north", degrees=round(abs(self.lat), 3))
        lon = message("west" if self.lon < 0 else "east", degrees=round(abs(self.lon), 3))
        if self.distance_km <= NEAR_KM:
            return message("near-town", town=town, lat=lat, lon=lon)
        return message("far-from-town", town=town, lat=lat, lon=lon, distance=self.distance_km * 1000)


def find_place(lon: float, lat: float) -> Place:
    """Takes degrees: -180 to 180 (also beyond, around the Earth) and -90 to 90."""
    nearest = min(towns(), key=lambda town: _distance_km(lon, lat, town.lon, town.lat))
    return Place(lon, lat, nearest, _distance_km(lon, lat, nearest.lon, nearest.lat))


def _distance_km(lon: float, lat: float, other_lon: float, other_lat: float) -> float:
    """Computes the length of the great circle."""
    a, b, along = math.radians(lat), math.radians(other_lat), math.radians(other_lon - lon)
    half = math.sin((b - a) / 2) ** 2 + math.cos(a) * math.cos(b) * math.sin(along / 2) ** 2
    return 2 * EARTH_RADIUS_KM * math.asin(min(1.0, math.sqrt(half)))
