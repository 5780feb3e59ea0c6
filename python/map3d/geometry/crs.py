"""Parses the names of coordinate reference systems that files use, and splits a CRS into its horizontal and vertical parts."""

import re
from functools import lru_cache
from typing import Final

from pyproj import CRS, network
from pyproj.crs import CompoundCRS
from pyproj.exceptions import CRSError

from map3d.errors import CrsError
from map3d.geometry.heights import ELLIPSOIDAL

network.set_network_enabled(False)  # type: ignore[attr-defined]

_ADV_HORIZONTAL: Final = {
    "ETRS89_UTM31": 25831,
    "ETRS89_UTM32": 25832,
    "ETRS89_UTM33": 25833,
    "ETRS89_UTM34": 25834,
    "ETRS89_LAT-LON": 4258,
    "ETRS89_LAT-LON-H": 4937,
    "DHDN_3GK2": 31466,
    "DHDN_3GK3": 31467,
    "DHDN_3GK4": 31468,
    "DHDN_3GK5": 31469,
    "PD83_3GK4": 3396,
    "PD83_3GK5": 3397,
    "RD83_3GK4": 3398,
    "RD83_3GK5": 3399,
    "42-83_3GK4": 2398,
    "42-83_3GK5": 2399,
}
_ADV_VERTICAL: Final = {
    "DHHN85_NOH": 5784,
    "DHHN92_NH": 5783,
    "DHN92_NH": 5783,
    "DHHN2016_NH": 7837,
    "DHHN12_NOH": 7699,
    "SNN76_NH": 5785,
    "HN76_NH": 5785,
}
"""EPSG codes of the names that the German surveying authorities (AdV) use, as in urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH. Bavaria
also writes DHN92."""

_EPSG_PART: Final = re.compile(r"(?:^|[:/#])EPSG(?::|/)(?:[0-9.]*[:/])?(?::)?([0-9]+)$", re.IGNORECASE)
_GML_EPSG: Final = re.compile(r"epsg\.xml#([0-9]+)$", re.IGNORECASE)


@lru_cache(maxsize=64)
def parse_crs(name: str) -> CRS:
    """Parses an EPSG code, OGC URN or URL (also compound), AdV URN, WKT or PROJ string. Raises CrsError."""
    text = name.strip()
    try:
        crs = _parse_adv(text) or _parse_compound(text) or _parse_epsg(text) or CRS.from_user_input(text)
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


def _parse_adv(text: str) -> CRS | None:
    if not text.lower().startswith("urn:adv:crs:"):
        return None
    parts = [part.upper().removeprefix("DE_") for part in text[len("urn:adv:crs:") :].split("*")]
    code = _ADV_HORIZONTAL.get(parts[0])
    if code is None or len(parts) > 2 or (len(parts) == 2 and parts[1] not in _ADV_VERTICAL):
        raise ValueError(text)
    return _make_crs(code, _ADV_VERTICAL[parts[1]] if len(parts) == 2 else None)


def _parse_compound(text: str) -> CRS | None:
    """Parses `urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783`, `EPSG:25832+5783`, `…/crs-compound?1=…&2=…`, `EPSG::25832*EPSG::5783`,
    and `urn:ogc:def:crs:EPSG:25832, crs:EPSG:5783`, as in examples of the OGC."""
    if "crs-compound?" in text:
        parts = [part.partition("=")[2] for part in text.partition("?")[2].split("&")]
    elif text.lower().startswith("urn:ogc:def:crs") and "," in text:
        parts = [part.strip() for part in text.split(",") if part.strip().lower() != "urn:ogc:def:crs"]
    elif re.search(r"EPSG\S*[+*]", text, re.IGNORECASE):
        parts = [part if "epsg" in part.lower() else f"EPSG:{part}" for part in re.split(r"[+*]", text)]
    else:
        return None
    codes = [code for code in map(_find_epsg_code, parts) if code is not None]
    if len(codes) != len(parts) or len(codes) not in (1, 2):
        raise ValueError(text)
    return _make_crs(*codes)


def _parse_epsg(text: str) -> CRS | None:
    code = _find_epsg_code(text)
    return None if code is None else CRS.from_epsg(code)


def _find_epsg_code(text: str) -> int | None:
    match = _EPSG_PART.search(text) or _GML_EPSG.search(text)
    return int(match[1]) if match else None


def _make_crs(horizontal: int, vertical: int | None = None) -> CRS:
    """Takes EPSG codes."""
    first = CRS.from_epsg(horizontal)
    if vertical is None:
        return first
    second = CRS.from_epsg(vertical)
    return CompoundCRS(name=f"{first.name} + {second.name}", components=[first, second])
