"""The plane of a view as a coordinate reference system, so that GIS software draws its two-dimensional data over the tiles.

Seen from a fixed direction, the points of one height map to the plane of the view by an affine map of the ground. WKT2 and PROJJSON express that as a
derived projected CRS: the CRS of the scene, and an affine parametric transformation (EPSG method 9624). Its coordinates are U and V in metres
(spec/pyramid.md §1). Points at other heights appear moved up or down by cos(pitch) of the difference.
"""

import math
from typing import Any, Final

from pyproj import CRS
from pyproj.exceptions import CRSError

from map3d.errors import BadRequest, CrsError
from map3d.geometry.crs import horizontal_crs
from map3d.geometry.frames import PinnedFrame
from map3d.geometry.views import axes
from map3d.types import Vec3, ViewAngles

MAX_HEIGHT_M: Final = 100_000.0
_METHOD: Final = {"name": "Affine parametric transformation", "id": {"authority": "EPSG", "code": 9624}}
_PARAMETERS: Final = {"A0": 8623, "A1": 8624, "A2": 8625, "B0": 8639, "B1": 8640, "B2": 8641}
"""Parameters of the method, and their EPSG codes: U = A0 + A1·X + A2·Y, V = B0 + B1·X + B2·Y, with easting X and northing Y."""
_PLANE: Final = {
    "subtype": "Cartesian",
    "axis": [
        {"name": "U", "abbreviation": "U", "direction": "east", "unit": "metre"},
        {"name": "V", "abbreviation": "V", "direction": "north", "unit": "metre"},
    ],
}
"""GIS software expects a plane whose axes are called east and north: to the right, and up."""


def check_height(height_m: float) -> float:
    """Returns the height of a reference plane. Raises BadRequest unless it is finite and within ±MAX_HEIGHT_M."""
    if not (math.isfinite(height_m) and abs(height_m) <= MAX_HEIGHT_M):
        raise BadRequest(f"reference height is {height_m} m, expected a number between -{MAX_HEIGHT_M:.0f} and {MAX_HEIGHT_M:.0f}")
    return height_m


def view_plane_crs(frame: PinnedFrame, origin: Vec3, base: CRS | None, height_m: float, name: str) -> CRS:
    """Returns the CRS of a view's plane for ground points at `height_m`, a height in the scene's CRS.

    `base`: the scene's CRS in any axis order, None for a scene with local coordinates, which gives an engineering CRS with the same U and V.
    `origin`: world position of the local origin, east first. Raises BadRequest for the height, CrsError when the base has no plane coordinates.
    """
    check_height(height_m)
    return _engineering_crs(name) if base is None else _derived_crs(frame.angles, origin, horizontal_crs(base), height_m, name)


def affine_parameters(angles: ViewAngles, origin: Vec3, height_m: float, unit_m: float = 1.0) -> dict[str, float]:
    """Returns the parameters of U and V for an easting X and a northing Y in units of `unit_m` metres."""
    plane = axes(angles)
    parameters = {}
    for letter, axis in (("A", plane.right), ("B", plane.up)):
        parameters[f"{letter}0"] = -axis[0] * origin[0] - axis[1] * origin[1] + axis[2] * (height_m - origin[2])
        parameters[f"{letter}1"], parameters[f"{letter}2"] = axis[0] * unit_m, axis[1] * unit_m
    return parameters


def _derived_crs(angles: ViewAngles, origin: Vec3, base: CRS, height_m: float, name: str) -> CRS:
    values = affine_parameters(angles, origin, height_m, base.axis_info[0].unit_conversion_factor)
    parameters = [
        {"name": key, "value": value, "unit": "metre" if key[1] == "0" else "unity", "id": {"authority": "EPSG", "code": _PARAMETERS[key]}}
        for key, value in values.items()
    ]
    return _crs(
        {
            "type": "DerivedProjectedCRS",
            "name": name,
            "base_crs": _east_first(base),
            "conversion": {"name": f"view plane at height {height_m:g} m", "method": _METHOD, "parameters": parameters},
            "coordinate_system": _PLANE,
        }
    )


def _east_first(base: CRS) -> dict[str, Any]:
    """Returns the PROJJSON of a projected CRS with the easting first.

    The WKT of a derived CRS omits the axes of its base, and programs disagree about them: PROJ 9.1 assumes east and north also for EPSG:31467, whose
    first axis is north; PROJ 9.5 looks the order up. A base without an identifier, east first, means the same to all. Raises CrsError.
    """
    document: dict[str, Any] = base.to_json_dict()
    document.pop("$schema", None)
    directions = [axis.direction.lower() for axis in base.axis_info]
    if not base.is_projected or sorted(directions) != ["east", "north"]:
        raise CrsError(f"{base.name}: expected a projected CRS with axes to the east and to the north, got {base.type_name} with {directions}")
    if directions == ["north", "east"]:
        document.pop("id", None)
        document["name"] += " (east, north)"
        document["coordinate_system"]["axis"].reverse()
    return document


def _engineering_crs(name: str) -> CRS:
    datum = {"type": "EngineeringDatum", "name": "Local coordinates of the scene"}
    return _crs({"type": "EngineeringCRS", "name": name, "datum": datum, "coordinate_system": _PLANE})


def _crs(document: dict[str, Any]) -> CRS:
    try:
        return CRS.from_json_dict(document)
    except CRSError as error:
        raise CrsError(f"{document['name']}: PROJ does not accept the CRS of the view's plane: {error}") from error
