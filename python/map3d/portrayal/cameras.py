"""Cameras of views in a scene's local metres, in a canonical form: every way to ask for one view leads to one camera.

An orthographic view has no position: moving its POC moves the borders of the image and the depths. Its canonical camera is at the plane's origin, and
its window has absolute coordinates of the plane. Numbers are rounded to micrometres and nanoradians.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from map3d.geometry.frames import corners
from map3d.geometry.views import Axes, dot
from map3d.portrayal.projections import ProjectionRequest
from map3d.portrayal.request_crs import RequestCrs
from map3d.portrayal.service_exception import invalid
from map3d.types import Box, Vec3

DIRECTION_UP: Final = 2.0
"""An UP that is longer is the position of a point, from which the POC is subtracted."""
LEAST_DISTANCE_M: Final = 1e-4
COLLINEAR: Final = 1e-7
METRE_DIGITS: Final = 6
DIRECTION_DIGITS: Final = 9
MARGIN_M: Final = 1.0
"""Distance of clipping planes from the content that they do not touch."""
SAME_AXES: Final = 1e-6
"""Axes that differ by less are those of a stored pyramid: a millimetre over a kilometre."""


@dataclass(frozen=True)
class ViewCamera:
    """`window`: (left, right, bottom, top), metres or tangents; `near_m`, `far_m`: along forward from `position`. `depth_zero_m`: where the depths of
    the request begin, along forward from `position`."""

    projection: str
    position: Vec3
    axes: Axes
    window: tuple[float, float, float, float]
    near_m: float
    far_m: float
    width_px: int
    height_px: int
    depth_zero_m: float = 0.0

    @property
    def is_orthographic(self) -> bool:
        return self.projection == "orthographic"

    def to_json(self) -> dict[str, Any]:
        """Returns the fields of a core camera as plain values."""
        return {
            "projection": self.projection,
            "position": list(self.position),
            "right": list(self.axes.right),
            "up": list(self.axes.up),
            "forward": list(self.axes.forward),
            "window": list(self.window),
            "near_m": self.near_m,
            "far_m": self.far_m,
            "width_px": self.width_px,
            "height_px": self.height_px,
        }


def to_camera(request: ProjectionRequest, crs: RequestCrs, width_px: int, height_px: int, locator: str, pyramids: Sequence[Axes] = ()) -> ViewCamera:
    """Returns the canonical camera of a projection. `pyramids`: axes of stored pyramids, which replace nearly equal ones.

    Raises InvalidParameterValue.
    """
    window = request.window(width_px, height_px)
    near_m, far_m = request.planes()
    poc, poi = request.position("POC"), request.position("POI")
    assert poc is not None, "the parser requires it"
    assert poi is not None, "the parser requires it"
    position = crs.to_local(poc, locator)
    axes = _axes(position, crs.to_local(poi, locator), _up(request, crs, poc, position, locator), locator)
    if request.projection.name == "Perspective":
        x, y, z = (_metres(value) for value in position)
        return ViewCamera("perspective", (x, y, z), _round_axes(axes), _digits(window, 9), _metres(near_m), _metres(far_m), width_px, height_px)
    stored = next((one for one in pyramids if _are_close(one, axes)), None)
    axes = stored or _round_axes(axes)
    u, v, d = (dot(axis, position) for axis in axes)
    left, right, bottom, top = window
    near, far = _metres(d + near_m), _metres(d + far_m)
    plane = _digits((u + left, u + right, v + bottom, v + top), METRE_DIGITS)
    return ViewCamera("orthographic", (0.0, 0.0, 0.0), axes, plane, near, far, width_px, height_px, _metres(d))


def clip_to_content(camera: ViewCamera, extent: Box | None) -> ViewCamera:
    """Returns the camera with planes that lie in front of all content and behind it moved close to it, since their distance does not matter."""
    if extent is None:
        return camera
    x, y, z = camera.position
    u, v, d = camera.axes.forward
    depths = (np.array(corners(extent)) - (x, y, z)) @ (u, v, d)
    nearest, farthest = math.floor(float(depths.min())) - MARGIN_M, math.ceil(float(depths.max())) + MARGIN_M
    near_m = nearest if camera.is_orthographic and camera.near_m < nearest else camera.near_m
    return replace(camera, near_m=near_m, far_m=min(camera.far_m, max(farthest, near_m + MARGIN_M)))


def _up(request: ProjectionRequest, crs: RequestCrs, poc: Vec3, position: Vec3, locator: str) -> Vec3 | None:
    """Returns the upward direction; None if it was not requested."""
    up = request.position("UP")
    if up is None:
        return None
    if math.hypot(*up) <= DIRECTION_UP:
        return crs.direction_to_local(up)
    return _minus(crs.to_local(up, locator), position)


def _axes(position: Vec3, target: Vec3, up: Vec3 | None, locator: str) -> Axes:
    sight = _minus(target, position)
    distance = math.hypot(*sight)
    if distance < LEAST_DISTANCE_M:
        raise invalid(locator, "POC and POI are the same point")
    forward = _scaled(sight, 1 / distance)
    wanted = up or ((0.0, 0.0, 1.0) if math.hypot(forward[0], forward[1]) > COLLINEAR else (0.0, 1.0, 0.0))
    length = math.hypot(*wanted)
    right = _cross(forward, wanted)
    if length == 0 or math.hypot(*right) < COLLINEAR * length:
        raise invalid(locator, "UP has the direction of the view; to look straight down with north above, give UP as 0,1,0")
    right = _scaled(right, 1 / math.hypot(*right))
    return Axes(right, _cross(right, forward), forward)


def _round_axes(axes: Axes) -> Axes:
    """Returns orthonormal axes that depend only on the rounded directions."""
    forward, up = (_rounded(axis) for axis in (axes.forward, axes.up))
    forward = _scaled(forward, 1 / math.hypot(*forward))
    right = _cross(forward, up)
    right = _scaled(right, 1 / math.hypot(*right))
    return Axes(right, _cross(right, forward), forward)


def _are_close(a: Axes, b: Axes) -> bool:
    return all(abs(p - q) <= SAME_AXES for one, other in zip(a, b, strict=True) for p, q in zip(one, other, strict=True))


def _metres(value: float) -> float:
    return round(value, METRE_DIGITS) + 0.0


def _digits(window: tuple[float, float, float, float], digits: int) -> tuple[float, float, float, float]:
    left, right, bottom, top = (round(value, digits) + 0.0 for value in window)
    return left, right, bottom, top


def _rounded(vector: Vec3) -> Vec3:
    x, y, z = (round(value, DIRECTION_DIGITS) + 0.0 for value in vector)
    return x, y, z


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def _scaled(a: Vec3, factor: float) -> Vec3:
    return (a[0] * factor, a[1] * factor, a[2] * factor)


def _cross(a: Vec3, b: Vec3) -> Vec3:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
