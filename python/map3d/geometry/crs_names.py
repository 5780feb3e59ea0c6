"""The names of coordinate reference systems that files and people write."""

import re
from typing import Final

from pyproj import CRS
from pyproj.crs import CompoundCRS
from pyproj.exceptions import CRSError

_ADV_HORIZONTAL: Final = {
    "ETRS89_UTM31": 25831,
    "ETRS89_UTM32": 25832,
    "ETRS89_UTM33": 25833,
    "ETRS89_UTM34": 25834,
    "ETRS89_UTM31_ZE-N": 5649,
    "ETRS89_UTM32_ZE-N": 4647,
    "ETRS89_UTM33_ZE-N": 5650,
    "ETRS89_LAT-LON": 4258,
    "ETRS89_LAT-LON-H": 4937,
    "DHDN_LAT-LON": 4314,
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
    "DHHN92_NHN": 5783,
    "DHHN2016_NH": 7837,
    "DHHN2016_NHN": 7837,
    "DHHN2016": 7837,
    "DHHN92": 5783,
    "NHN": 7837,
    "DHHN12_NOH": 7699,
    "SNN76_NH": 5785,
    "HN76_NH": 5785,
}
"""EPSG codes of the names that the German surveying authorities (AdV) use, as in urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH. Bavaria also writes DHN92.
NHN alone is the height system that has been in force since 2017."""

_QUASIGEOID: Final = re.compile(r"[_*](?:DE_)?GCG\d{2,4}\w?(?=\*|$)")
"""The model with which heights were found, which says nothing about what they refer to: *GCG2016, _GCG2016."""
_REGION: Final = re.compile(r"(_3GK\d)_[A-Z]{2}\d{3}$")
"""The regional fit of Gauss-Krüger coordinates, as in DHDN_3GK2_NW101."""

_EPSG_PART: Final = re.compile(r"(?:^|[:/#])EPSG(?::|/)(?:[\w.]*[:/])?(?::)?([0-9]+)$", re.IGNORECASE)
_EPSG_OTHER: Final = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"^(?:EPSG[\s_.-]*)?([0-9]{4,6})$",
        r"epsg\.xml#([0-9]+)$",
        r"\bepsg\.io/([0-9]+)(?:\.\w+)?$",
        r"\bepsg\.org/crs[_/]([0-9]+)(?:/\S*)?$",
        r"\bspatialreference\.org/ref/epsg/([0-9]+)(?:/\S*)?$",
    )
)
_CRS84: Final = re.compile(r"(?:[:/]|^)(?:CRS:?)?(84h?|83|27)$", re.IGNORECASE)
_OGC_PART: Final = re.compile(r"(?:[:/]|^)(?:OGC|CRS)\b", re.IGNORECASE)
_STRUCTURED: Final = re.compile(r"^\s*(?:\{|\w+\s*[\[(])")
_WEB_MERCATOR: Final = frozenset({900913, 102100, 102113, 3785})
MAX_SHORT_NAME: Final = 200
_IDENTIFIED: Final = 70
"""Least confidence of PROJ, in percent, with which a description counts as that of an EPSG code."""


def read_name(text: str) -> CRS:
    """Reads an EPSG code, an OGC URN or URL (also compound), an AdV name, the address of a page about a code, WKT, PROJJSON or a PROJ string.

    Raises ValueError or pyproj's CRSError.
    """
    if _STRUCTURED.match(text):
        return _identified(CRS.from_user_input(text))
    text = text.rstrip("/")
    return _read_adv(text) or _read_compound(text) or _read_epsg(text) or _read_ogc(text) or CRS.from_user_input(text)


def is_description(text: str) -> bool:
    """Whether a text is WKT or PROJJSON, which states the order of its axes."""
    return _STRUCTURED.match(text) is not None


def is_short_name(text: str) -> bool:
    """Whether a text names a CRS in the catalogue of PROJ, other than a description, which only a limited process parses."""
    return len(text) <= MAX_SHORT_NAME and not _STRUCTURED.match(text) and "+proj" not in text and "+init" not in text


def find_epsg_code(text: str) -> int | None:
    """Returns the EPSG code that a name of one CRS states."""
    found = (pattern.search(text) for pattern in (_EPSG_PART, *_EPSG_OTHER))
    match = next((match for match in found if match is not None), None)
    return None if match is None else int(match[1])


def _identified(crs: CRS) -> CRS:
    """Returns the CRS of the EPSG code that a description means, so that it is the same as where files name the code. A description of degrees counts
    as it is, since it states the order of axes."""
    if not crs.is_projected or crs.is_bound:
        return crs
    code = crs.to_epsg(min_confidence=_IDENTIFIED)
    return crs if code is None else CRS.from_epsg(code)


def _read_adv(text: str) -> CRS | None:
    is_adv = text.lower().startswith("urn:adv:crs:")
    name = _QUASIGEOID.sub("", re.split(r"[:/#]", text)[-1].upper())
    parts = [part.removeprefix("DE_") for part in name.split("*")]
    horizontal = _REGION.sub(r"\1", parts[0]).replace("RD-83", "RD83").replace("PD-83", "PD83")
    horizontal = re.sub(r"^UTM", "ETRS89_UTM", horizontal) if is_adv or "ZE-N" in horizontal else horizontal
    code = _ADV_HORIZONTAL.get(horizontal)
    if code is None or len(parts) > 2 or (len(parts) == 2 and parts[1] not in _ADV_VERTICAL):
        if is_adv:
            raise ValueError(text)
        return None
    return _make_crs(code, _ADV_VERTICAL[parts[1]] if len(parts) == 2 else None)


def _read_compound(text: str) -> CRS | None:
    """Reads `urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783`, `EPSG:25832+5783`, `…/crs-compound?1=…&2=…`, `EPSG::25832*EPSG::5783`,
    and `urn:ogc:def:crs:EPSG:25832, crs:EPSG:5783`, as in examples of the OGC."""
    if "crs-compound?" in text:
        parts = [part.partition("=")[2] for part in text.partition("?")[2].split("&")]
    elif "," in text and "epsg" in text.lower():
        parts = [part.strip() for part in text.split(",") if part.strip().lower() != "urn:ogc:def:crs"]
    elif re.search(r"EPSG\S*\s*[+*]", text, re.IGNORECASE):
        parts = [part if "epsg" in part.lower() else f"EPSG:{part}" for part in map(str.strip, re.split(r"[+*]", text))]
    else:
        return None
    codes = [code for code in map(find_epsg_code, parts) if code is not None]
    if len(codes) != len(parts) or len(codes) not in (1, 2):
        raise ValueError(text)
    return _make_crs(*codes)


def _read_epsg(text: str) -> CRS | None:
    code = find_epsg_code(text)
    return None if code is None else _from_code(code)


def _read_ogc(text: str) -> CRS | None:
    match = _CRS84.search(text)
    if match is None or not _OGC_PART.search(text):
        return None
    return CRS.from_user_input(f"OGC:CRS{match[1].lower()}")


def _from_code(code: int) -> CRS:
    """Codes that Esri gave are often written as those of EPSG."""
    if code in _WEB_MERCATOR:
        return CRS.from_epsg(3857)
    try:
        return CRS.from_epsg(code)
    except CRSError:
        return CRS.from_authority("ESRI", code)


def _make_crs(horizontal: int, vertical: int | None = None) -> CRS:
    """Takes EPSG codes."""
    first = _from_code(horizontal)
    if vertical is None:
        return first
    second = CRS.from_epsg(vertical)
    return CompoundCRS(name=f"{first.name} + {second.name}", components=[first, second])
