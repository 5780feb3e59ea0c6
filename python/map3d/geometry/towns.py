"""Large towns of all continents, to say where on Earth coordinates are. Written from public facts; positions are within some kilometres."""

import csv
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path


@dataclass(frozen=True)
class Town:
    """Degrees, WGS 84."""

    name: str
    country: str
    lat: float
    lon: float


@lru_cache(maxsize=1)
def towns() -> tuple[Town, ...]:
    """Reads towns.tsv once."""
    with Path(__file__).with_name("towns.tsv").open(encoding="utf-8", newline="") as file:
        return tuple(Town(row["name"], row["country"], float(row["lat"]), float(row["lon"])) for row in csv.DictReader(file, delimiter="\t"))
