"""Parses names of coordinate reference systems, and splits a CRS into its horizontal and vertical parts."""

from functools import lru_cache

from pyproj import CRS, network
from pyproj.exceptions import CRSError

from map3d.errors import CrsError
from map3d.geometry.crs_names import read_name
from map3d.geometry.heights import ELLIPSOIDAL

network.set_network_enabled(False)  # type: ignore[attr-defined]


@lru_cache(maxsize=64)
def parse_crs(name: str) -> CRS:
    """Parses the name of a CRS in any form of `crs_names`. Raises CrsError."""
    try:
        crs = read_name(name.strip())
    except (CRSError, ValueError) as error:
        raise CrsError(f"unknown CRS {name[:200]!r}; name the right one with --crs, e.g. --crs EPSG:25832") from error
    if (crs.sub_crs_list or [crs])[0].is_vertical:
        raise CrsError(f"CRS {name[:200]!r} ({crs.name}) has heights alone; name the whole with --crs, e.g. --crs EPSG:25832+5783")
    return crs


def is_local(name: str) -> bool:
    """Whether the name means plain metres without a known CRS."""
    return name.strip().lower() == "local"


def horizontal_crs(crs: CRS) -> CRS:
    """Returns the two-dimensional part."""
    part = crs.sub_crs_list[0] if crs.is_compound else crs
    if part.is_bound and part.source_crs is not None:
        part = part.source_crs
    return part.to_2d() if len(part.axis_info) == 3 else part


def vertical_crs(crs: CRS) -> CRS | None:
    """Returns the vertical part of a compound CRS; None for any other, also with ellipsoidal heights."""
    return crs.sub_crs_list[1] if crs.is_compound else None


def vertical_crs_name(crs: CRS) -> str | None:
    """Returns the name of the height system, None if the CRS has no heights."""
    part = vertical_crs(crs)
    if part is not None:
        return str(part.name)
    return f"{ELLIPSOIDAL} ({crs.geodetic_crs.name})" if len(crs.axis_info) == 3 and crs.geodetic_crs is not None else None


def has_ellipsoidal_heights(crs: CRS) -> bool:
    """Whether heights are above the ellipsoid: a system of three axes without a vertical part."""
    return len(crs.axis_info) == 3 and not crs.is_compound


def vertical_unit_m(crs: CRS) -> float:
    """Returns the metres per unit of the third axis; 1 without one."""
    axes = crs.axis_info
    return float(axes[2].unit_conversion_factor) if len(axes) == 3 else 1.0


def is_metric(crs: CRS) -> bool:
    """Whether the CRS is projected in metres, as a scene requires."""
    part = horizontal_crs(crs)
    return bool(part.is_projected and all(abs(axis.unit_conversion_factor - 1.0) < 1e-12 for axis in part.axis_info))
