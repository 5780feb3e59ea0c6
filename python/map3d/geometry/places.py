"""Says where on Earth a position is: near which large town."""

import math
from dataclasses import dataclass
from typing import Final

from map3d.geometry.towns import Town, towns

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
        town = f"{self.town.name}, {self.town.country}" if self.town.name != self.town.country else self.town.name
        if self.distance_km <= NEAR_KM:
            return f"near {town} ({degrees_text(self.lon, self.lat)})"
        return f"at {degrees_text(self.lon, self.lat)}, {self.distance_km:,.0f} km from {town}"


def find_place(lon: float, lat: float) -> Place:
    """Takes degrees: -180 to 180 (also beyond, around the Earth) and -90 to 90."""
    nearest = min(towns(), key=lambda town: _distance_km(lon, lat, town.lon, town.lat))
    return Place(lon, lat, nearest, _distance_km(lon, lat, nearest.lon, nearest.lat))


def degrees_text(lon: float, lat: float) -> str:
    """Returns e.g. "48.137° N, 11.575° E"."""
    return f"{abs(lat):.3f}° {'S' if lat < 0 else 'N'}, {abs(lon):.3f}° {'W' if lon < 0 else 'E'}"


def _distance_km(lon: float, lat: float, other_lon: float, other_lat: float) -> float:
    """Computes the length of the great circle."""
    a, b, along = math.radians(lat), math.radians(other_lat), math.radians(other_lon - lon)
    half = math.sin((b - a) / 2) ** 2 + math.cos(a) * math.cos(b) * math.sin(along / 2) ** 2
    return 2 * EARTH_RADIUS_KM * math.asin(min(1.0, math.sqrt(half)))
