"""Coordinate systems of requests: their names, axis order, and the way to a scene's local metres.

Clients may only name systems that a layer advertises, in any usual spelling, so that no text of a request reaches a parser of projections. Heights
stay as they are: they refer to the vertical datum that the layer advertises.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from map3d.catalogue import SceneRecord
from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs, vertical_crs
from map3d.portrayal.service_exception import ServiceException, invalid, quote
from map3d.types import Vec3

WGS84: Final = "EPSG:4326"
CRS84: Final = "CRS:84"
LOCAL_PREFIX: Final = "urn:map3d:def:crs:local:"
_SPELLINGS: Final = (
    re.compile(r"EPSG:([0-9]{4,6})(?:[+ ]([0-9]{4,6}))?", re.ASCII | re.IGNORECASE),
    re.compile(r"urn:(?:x-)?ogc:def:crs:EPSG:[0-9.]*:([0-9]{4,6})()", re.ASCII | re.IGNORECASE),
    re.compile(r"urn:ogc:def:crs,crs:EPSG:[0-9.]*:([0-9]{4,6}),crs:EPSG:[0-9.]*:([0-9]{4,6})", re.ASCII | re.IGNORECASE),
    re.compile(r"https?://www\.opengis\.net/def/crs/EPSG/[0-9.]+/([0-9]{4,6})()", re.ASCII | re.IGNORECASE),
    re.compile(r"https?://www\.opengis\.net/gml/srs/epsg\.xml#([0-9]{4,6})()", re.ASCII | re.IGNORECASE),
)
_CRS84: Final = re.compile(
    r"CRS:84|OGC:CRS84|urn:ogc:def:crs:OGC:[0-9.]*:CRS84|https?://www\.opengis\.net/def/crs/OGC/1\.3/CRS84", re.ASCII | re.IGNORECASE
)


def canonical_name(text: str) -> str:
    """Returns `EPSG:n`, `EPSG:n+m`, `CRS:84` or the text itself. Raises InvalidParameterValue for a text that is too long."""
    name = text.strip()
    if len(name) > 200:
        raise invalid("crs", f"the name has {len(name)} characters, the limit is 200")
    if _CRS84.fullmatch(name):
        return CRS84
    for spelling in _SPELLINGS:
        match = spelling.fullmatch(name)
        if match:
            return f"EPSG:{int(match[1])}" + (f"+{int(match[2])}" if match[2] else "")
    return name


@dataclass(frozen=True)
class RequestCrs:
    """A coordinate system that a scene's layers advertise. `north_first`: the first axis points north. `transformer`: to the scene's easting and
    northing, None if the system is the scene's own."""

    name: str
    north_first: bool
    origin: Vec3
    transformer: Transformer | None
    geographic: bool

    def to_local(self, position: tuple[float, float, float], locator: str) -> Vec3:
        """Returns local metres. Raises InvalidParameterValue for a position outside the system's domain."""
        x, y = self.east_north(position[0], position[1])
        if self.geographic and not (abs(x) <= 360 and abs(y) <= 90):
            raise invalid(locator, f"longitude {x:g}, latitude {y:g} is outside {self.name}; mind the order of its axes")
        if self.transformer is not None:
            try:
                x, y = self.transformer.transform(x, y, errcheck=True)
            except ProjError as error:
                raise invalid(locator, f"position {position[0]:g}, {position[1]:g} cannot be transformed from {self.name}") from error
        local = (x - self.origin[0], y - self.origin[1], position[2] - self.origin[2])
        if not all(math.isfinite(value) for value in local):
            raise invalid(locator, f"position {position[0]:g}, {position[1]:g} is outside the domain of {self.name}")
        return local

    def from_local(self, local: Vec3) -> Vec3:
        """Returns coordinates in the order of the axes."""
        x, y, z = (value + offset for value, offset in zip(local, self.origin, strict=True))
        if self.transformer is not None:
            x, y = self.transformer.transform(x, y, direction="INVERSE")
        first, second = self.east_north(x, y)
        return (first, second, z)

    def direction_to_local(self, vector: tuple[float, float, float]) -> Vec3:
        """Returns a direction whose components follow the axes as east, north and up."""
        x, y = self.east_north(vector[0], vector[1])
        return (x, y, vector[2])

    def east_north(self, first: float, second: float) -> tuple[float, float]:
        return (second, first) if self.north_first else (first, second)


@dataclass(frozen=True)
class SceneSystems:
    """The systems of a scene's layers. `available`: by canonical name; `advertised`: their names in the order of the capabilities, then the vertical
    datum. `primary`: the scene's own system."""

    available: Mapping[str, RequestCrs]
    advertised: tuple[str, ...]
    primary: str

    def find(self, text: str, *, info: bool = False) -> RequestCrs:
        """Raises InvalidParameterValue, or CRSNotSupported for operations of the Info Extension."""
        found = self.available.get(canonical_name(text))
        if found is None:
            message = f"CRS {quote(text)} is not available; expected {', '.join(dict.fromkeys(self.available))}"
            raise ServiceException("CRSNotSupported", message, text) if info else invalid("crs", message)
        return found


def systems_of(scene: SceneRecord) -> SceneSystems:
    """Returns the coordinate systems in which a scene's layers are available."""
    assert scene.origin is not None, "built scenes have an origin"
    return _systems(scene.name, None if scene.crs is None else scene.crs.wkt, scene.origin)


@lru_cache(maxsize=256)
def _systems(scene: str, wkt: str | None, origin: Vec3) -> SceneSystems:
    if wkt is None:
        name = LOCAL_PREFIX + scene
        return SceneSystems({name: RequestCrs(name, False, origin, None, False)}, (name,), name)
    crs = parse_crs(wkt)
    flat, vertical = horizontal_crs(crs), vertical_crs(crs)
    code = _code(flat)
    primary = LOCAL_PREFIX + scene if code is None else f"EPSG:{code}"
    own = RequestCrs(primary, _is_north_first(flat), origin, None, False)
    height = None if vertical is None else _code(vertical)
    names = [primary]
    if code is not None and height is not None:
        names.append(f"{primary}+{height}")
    whole = _code(crs) if crs.is_compound else None
    if whole is not None:
        names.append(f"EPSG:{whole}")
    available = dict.fromkeys(names, own)
    to_own = _transformer(flat, origin)
    if to_own is not None:
        available[WGS84] = RequestCrs(WGS84, True, origin, to_own, True)
        available[CRS84] = RequestCrs(CRS84, False, origin, to_own, True)
    advertised = (*available, *([] if height is None else [f"EPSG:{height}"]))
    return SceneSystems(available, advertised, primary)


def _transformer(flat: CRS, origin: Vec3) -> Transformer | None:
    """Returns the transformer from longitude/latitude to easting/northing; None if the system does not locate the scene."""
    try:
        to_own = Transformer.from_crs(WGS84, flat, always_xy=True)
        place = to_own.transform(origin[0], origin[1], direction="INVERSE")
    except (CRSError, ProjError, CrsError):
        return None
    return to_own if all(math.isfinite(value) for value in place) else None


def _is_north_first(crs: CRS) -> bool:
    return bool(crs.axis_info) and crs.axis_info[0].direction.lower() in ("north", "south")


def _code(crs: CRS) -> int | None:
    code = crs.to_epsg(min_confidence=100)
    return None if code is None else int(code)
