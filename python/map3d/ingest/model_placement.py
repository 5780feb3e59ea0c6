"""Puts a model in its place: scales its coordinates to the unit of its coordinate system and adds an offset, as the user or files beside it say."""

import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from map3d.errors import CrsError
from map3d.formats import find_format
from map3d.geometry.area_of_use import AreaOfUse
from map3d.geometry.crs import horizontal_crs, is_local, parse_crs, vertical_unit_m
from map3d.ingest.findings import finding
from map3d.requests.reading import UNITS_M

_WKT_CODE: Final = re.compile(r'(?:AUTHORITY|ID)\["(EPSG|ESRI)",\s*"?(\d+)"?\]\s*\]\s*$')
_WKT_NAME: Final = re.compile(r'\s*[A-Z_]{4,20}\["([^"]{1,200})"')
OPTIONS: Final = ("offset", "unit")
"""Options of the reader that are done here."""


class ModelPlacement:
    """The options of the user count; what they leave open, files beside the model say. Only models have these options and files."""

    def __init__(self, request: Mapping[str, Any]) -> None:
        """`request`: that of map3d.ingest.parse_document, whose `place` is None or what map3d.formats.model_place found."""
        self._name, self._place = request["path"].rsplit("/", 1)[-1], request.get("place") or {}
        is_model = not find_format(request["format"]).has_crs
        self._unit, stated = request["reader"].get("unit", "auto"), request["crs"] if is_model else None
        self._is_stated = stated is not None
        self.findings: list[dict[str, Any]] = []
        if self._place.get("unreadable"):
            self.findings.append(finding("model-place-unreadable", 1, f"{self._name}: {self._place['unreadable']}"))
        found = self._place.get("offset") if not (stated and is_local(stated)) else None
        offset = request["reader"].get("offset") or found
        self._offset = None if offset is None else np.array(offset, dtype=np.float64)
        self._crs: str | None = stated or self._place.get("crs")
        self._is_placed = offset is not None and offset is found
        self._scale: NDArray[np.float64] | None = None

    def crs(self, first: NDArray[np.float64] | None) -> str | None:
        """Returns the coordinate system that a file beside the model names; None if there is none, or the user states one. One without an offset
        counts only if the first coordinates lie where it is used: otherwise the model has an origin of its own, which nothing says."""
        known = self._known_crs()
        if known is not None and self._offset is None and first is not None and not _lies_in(first, known):
            where = " ".join(f"{value:.6g}" for value in np.median(first[:, :2], axis=0))
            example = f"{self._name}: {where} is not in {known.name}; --offset X,Y,Z says where the origin lies"
            self.findings.append(finding("model-without-place", 1, example))
            if not self._is_stated:
                self._crs = self._scale = None
        elif self._is_placed or (known is not None and not self._is_stated):
            origin = [] if self._offset is None else [f"origin at {', '.join(f'{value:.10g}' for value in self._offset)}"]
            said = ", ".join(origin + ([] if known is None else [str(known.name)]))
            self.findings.append(finding("model-placed", 1, f"{self._name}: {said} ({self._files})"))
        return None if self._is_stated else self._crs

    def _known_crs(self) -> CRS | None:
        """Returns the horizontal coordinate system; None if there is none, and for one that a file names and that is unknown."""
        if self._crs is None or is_local(self._crs):
            return None
        for text in (self._crs, *_names_in_wkt(self._crs)):
            with suppress(CrsError):
                known = horizontal_crs(parse_crs(text))
                self._crs = text
                return known
        if self._is_stated:
            return horizontal_crs(parse_crs(self._crs))
        self.findings.append(finding("model-place-unreadable", 1, f"{self._name}: {self._files}: {self._crs[:80]}"))
        self._crs = self._offset = None
        self._is_placed = False
        return None

    @property
    def _files(self) -> str:
        return ", ".join(self._place.get("files", ()))

    def move(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Returns (n, 3) coordinates in the unit of the coordinate system, with the offset."""
        if self._unit != "auto":
            positions = positions * self._unit_scale()
        return positions if self._offset is None else positions + self._offset

    def _unit_scale(self) -> NDArray[np.float64]:
        if self._scale is None:
            self._scale = np.full(3, UNITS_M[self._unit])
            if self._crs is not None and not is_local(self._crs):
                crs = parse_crs(self._crs)
                if horizontal_crs(crs).is_geographic:
                    raise CrsError(f"--unit {self._unit}: the coordinates are degrees of {crs.name}; leave the option out")
                level = float(horizontal_crs(crs).axis_info[0].unit_conversion_factor)
                self._scale /= np.array([level, level, vertical_unit_m(crs)])
        return self._scale


def _names_in_wkt(text: str) -> list[str]:
    """Returns the code and the name of a system in a text that begins like WKT and is cut or too short."""
    code, name = _WKT_CODE.search(text), _WKT_NAME.match(text)
    return [*([] if code is None else [f"{code[1]}:{code[2]}"]), *([] if name is None else [name[1]])]


def _lies_in(positions: NDArray[np.float64], crs: CRS) -> bool:
    """Whether the middle of positions, east first, lies in the area of use of a system; true if that is not known."""
    area = AreaOfUse.of(crs)
    if area is None or not len(positions):
        return True
    x, y = np.median(positions[:, :2], axis=0)
    lon, lat = Transformer.from_crs(crs, "EPSG:4326", always_xy=True).transform(float(x), float(y))
    return bool(np.isfinite([lon, lat]).all() and area.contains(lon, lat))
