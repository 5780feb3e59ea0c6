"""Says where on Earth a position is: in or near which town, or how far from the nearest one, and in which direction."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from map3d.geometry.towns import Town, radius_km, towns
from map3d.messages import Message, message

EARTH_RADIUS_KM: Final = 6371.0
NEAR_KM: Final = 5.0
"""So far from a town's centre a position is near it, however small the town is."""
IN_REACH_KM: Final = 100.0
"""Farther away, the town's direction says little."""
FAR_KM: Final = 500.0
"""Farther away, no town tells where a position is."""
_DIRECTIONS: Final = ("n", "ne", "e", "se", "s", "sw", "w", "nw")


@dataclass(frozen=True)
class Place:
    """A position in degrees, WGS 84, and the nearest town, with the distance from its centre and the bearing from there, clockwise from north."""

    lon: float
    lat: float
    town: Town
    distance_km: float
    bearing_deg: float

    def __str__(self) -> str:
        """Returns e.g. "near Munich, Germany (48.137° N, 11.575° E)", or "24 km north-east of Munich, Germany (…)"."""
        return str(self.message)

    @property
    def message(self) -> Message:
        town = f"{self.town.name}, {self.town.country}" if self.town.name != self.town.country else self.town.name
        lat = message("south" if self.lat < 0 else "north", degrees=round(abs(self.lat), 3))
        lon = message("west" if self.lon < 0 else "east", degrees=round(abs(self.lon), 3))
        if self.distance_km <= max(NEAR_KM, radius_km(self.town.people)):
            return message("near-town", town=town, lat=lat, lon=lon)
        distance_m = self.distance_km * 1000
        if self.distance_km <= IN_REACH_KM:
            direction = message(f"direction-{_DIRECTIONS[round(self.bearing_deg / 45) % 8]}")
            return message("away-from-town", town=town, lat=lat, lon=lon, distance=distance_m, direction=direction)
        if self.distance_km <= FAR_KM:
            return message("far-from-town", town=town, lat=lat, lon=lon, distance=distance_m)
        return message("far-from-towns", lat=lat, lon=lon)


def find_place(lon: float, lat: float) -> Place:
    """Takes degrees: -180 to 180 (also beyond, around the Earth) and -90 to 90. The nearest town is the one whose edge is nearest; within several,
    the one in whose inner part the position lies most."""
    table = towns()
    own, others, along = math.radians(lat), np.radians(table.lat), np.radians(lon - table.lon)
    half = np.sin((own - others) / 2) ** 2 + np.cos(own) * np.cos(others) * np.sin(along / 2) ** 2
    distances_km = 2 * EARTH_RADIUS_KM * np.arcsin(np.minimum(1.0, np.sqrt(half)))
    outside_km = np.maximum(distances_km - table.radius_km, 0.0)
    k = int(np.lexsort((distances_km / table.radius_km, outside_km))[0])
    east = math.sin(along[k]) * math.cos(own)
    north = math.cos(others[k]) * math.sin(own) - math.sin(others[k]) * math.cos(own) * math.cos(along[k])
    return Place(lon, lat, table.towns[k], float(distances_km[k]), math.degrees(math.atan2(east, north)) % 360)
