"""What heights refer to: the geoid, by a vertical CRS, the ellipsoid, or something unknown."""

from typing import Final, Literal

Heights = Literal["geoid", "ellipsoid", "unknown"]

ELLIPSOIDAL: Final = "ellipsoidal height"
"""Names of ellipsoidal heights begin so."""


def heights_of(vertical: str | None) -> Heights:
    """Takes the name of a height system, None for an unknown one."""
    if vertical is None:
        return "unknown"
    return "ellipsoid" if vertical.startswith(ELLIPSOIDAL) else "geoid"


def find_vertical_epsg(wkt: str | None) -> int | None:
    """Returns the EPSG code of the vertical part of a CRS, or None."""
    from map3d.geometry.crs import parse_crs, vertical_crs

    part = None if wkt is None else vertical_crs(parse_crs(wkt))
    code = None if part is None else part.to_epsg(min_confidence=100)
    return None if code is None else int(code)
