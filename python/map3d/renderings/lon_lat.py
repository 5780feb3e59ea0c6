"""Polynomials between a scene's local coordinates and longitude and latitude, so that clients need no projection library."""

import math
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

from map3d.catalogue import SceneRecord
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.tiles.manifest import Geographic
from map3d.types import Box, Vec3

WGS84: Final = "EPSG:4326"
DEGREES: Final = range(2, 8)
ENOUGH_M: Final = 0.0005
"""The lowest degree whose error is below this is used."""
NODES, CHECKS = 16, 23
"""Points along a side of the grids for the fit and for measuring its error."""
MARGIN, MARGIN_M = 0.25, 500.0
METRES_A_DEGREE: Final = 111_320.0
Points = NDArray[np.float64]


def geographic_of(scene: SceneRecord, box: Box) -> Geographic | None:
    """Fits the polynomials to the local `box` with a margin; returns None when the coordinate system does not locate the scene."""
    crs = scene.crs
    return None if crs is None or crs.wkt is None or scene.origin is None else _fitted(crs.wkt, scene.origin, box)


@lru_cache(maxsize=16)
def _fitted(wkt: str, origin: Vec3, box: Box) -> Geographic | None:
    to_degrees = Transformer.from_crs(horizontal_crs(parse_crs(wkt)), WGS84, always_xy=True)
    middle = (round((box[0][0] + box[1][0]) / 2, 3), round((box[0][1] + box[1][1]) / 2, 3))
    unit_m = round(max(box[1][k] - box[0][k] for k in (0, 1)) / 2 * (1 + MARGIN) + MARGIN_M, 3)
    lon, lat = to_degrees.transform(origin[0] + middle[0], origin[1] + middle[1])
    if not (math.isfinite(lon) and math.isfinite(lat)):
        return None
    center = (round(lon, 9), round(lat, 9))

    def degrees(unit: Points) -> Points:
        """Returns (longitude, latitude) relative to the centre, for points in units of `unit_m`."""
        lon, lat = to_degrees.transform(origin[0] + middle[0] + unit[:, 0] * unit_m, origin[1] + middle[1] + unit[:, 1] * unit_m)
        return np.stack([(np.asarray(lon) - center[0] + 180.0) % 360.0 - 180.0, np.asarray(lat) - center[1]], axis=1)

    nodes, checks = _grid(np.cos((np.arange(NODES) + 0.5) * np.pi / NODES)), _grid(np.linspace(-1, 1, CHECKS))
    there, tested = degrees(nodes), degrees(checks)
    if not (np.isfinite(there).all() and np.isfinite(tested).all()):
        return None
    unit_deg = round(float(np.abs(there).max()), 9)
    a_degree = METRES_A_DEGREE * np.array([math.cos(math.radians(center[1])), 1.0])
    fitted = None
    for degree in DEGREES:
        to, back = _fit(nodes, there, degree, 14), _fit(there / unit_deg, nodes * unit_m, degree, 7)
        errors = (
            (_terms(checks, degree) @ to - tested) * a_degree,
            _terms(tested / unit_deg, degree) @ back - checks * unit_m,
        )
        error_m = max(float(np.abs(e).max()) for e in errors)
        fitted = Geographic(middle, center, unit_m, unit_deg, degree, _rows(to), _rows(back), round(error_m, 6))
        if error_m < ENOUGH_M:
            break
    return fitted


def _grid(side: Points) -> Points:
    x, y = np.meshgrid(side, side)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def _terms(places: Points, degree: int) -> Points:
    """Returns one row 1, x, y, x², xy, y², … per point."""
    x, y = places[:, 0], places[:, 1]
    return np.stack([x ** (total - k) * y**k for total in range(degree + 1) for k in range(total + 1)], axis=1)


def _fit(places: Points, values: Points, degree: int, digits: int) -> Points:
    """Returns the coefficients, rounded so that they are the same on every machine."""
    return np.round(np.linalg.lstsq(_terms(places, degree), values, rcond=None)[0], digits) + 0.0


def _rows(coefficients: Points) -> tuple[tuple[float, ...], tuple[float, ...]]:
    first, second = (tuple(float(c) for c in column) for column in coefficients.T)
    return first, second
