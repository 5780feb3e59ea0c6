"""Towns over 15,000 inhabitants, to say where on Earth coordinates are: GeoNames (https://www.geonames.org, CC BY 4.0), by docs/make_towns.py."""

import gzip
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

FILE: Final = Path(__file__).with_name("towns.tsv.gz")
_KM_A_ROOT: Final = 0.01
"""A usual town of N inhabitants is a disc with this radius times √N: 1.2 km for 15,000, 11 km for Munich, 30 km for London."""


def radius_km(people: float) -> float:
    """Returns how far from its centre a town of this population reaches."""
    return _KM_A_ROOT * math.sqrt(people)


@dataclass(frozen=True)
class Town:
    """Degrees, WGS 84."""

    name: str
    country: str
    lat: float
    lon: float
    people: int


@dataclass(frozen=True)
class TownTable:
    """Towns with their positions, (n,) degrees, and radii, (n,) km."""

    towns: tuple[Town, ...]
    lat: NDArray[np.float64]
    lon: NDArray[np.float64]
    radius_km: NDArray[np.float64]


@lru_cache(maxsize=1)
def towns() -> TownTable:
    """Reads the towns once."""
    with gzip.open(FILE, "rt", encoding="utf-8") as file:
        rows = [line.rstrip("\n").split("\t") for line in file if not line.startswith("#")]
    found = tuple(Town(name, country, float(lat), float(lon), int(people)) for name, country, lat, lon, people in rows)
    numbers = np.array([(town.lat, town.lon, radius_km(town.people)) for town in found])
    return TownTable(found, *numbers.T)
