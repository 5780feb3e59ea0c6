"""Views: the axes of a look-at angle and a pitch, local and view coordinates, view ids (spec/pyramid.md §1).

Sums are written out term by term, so that the bits do not depend on a linear algebra library.
"""

import math
import re
from collections.abc import Sequence
from decimal import Decimal
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from map3d.errors import BadRequest
from map3d.types import Vec3, ViewAngles

DEFAULT_PITCH_DEG: Final = 45.0

_EXACT: Final = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
_COS_HALF: Final = {60.0: 0.5, 300.0: 0.5, 120.0: -0.5, 240.0: -0.5}
_SIN_HALF: Final = {30.0: 0.5, 150.0: 0.5, 210.0: -0.5, 330.0: -0.5}
_ID: Final = re.compile(r"((?:0|[1-9][0-9]{0,2})(?:\.[0-9]{1,17})?)-((?:0|[1-9][0-9]?)(?:\.[0-9]{1,17})?)", re.ASCII)


class Axes(NamedTuple):
    """Orthonormal axes of a view in local coordinates: right → U, up → V, forward (away from the viewer) → D."""

    right: Vec3
    up: Vec3
    forward: Vec3


def cos_sin(angle_deg: float) -> tuple[float, float]:
    """Returns (cos, sin), exact at multiples of 90° and where one of them is a half."""
    angle_deg %= 360.0
    if angle_deg in _EXACT:
        return _EXACT[angle_deg]
    rad = math.radians(angle_deg)
    return _COS_HALF.get(angle_deg, math.cos(rad)), _SIN_HALF.get(angle_deg, math.sin(rad))


def check_angles(angles: ViewAngles) -> ViewAngles:
    """Returns `angles` as floats if 0 ≤ look-at < 360 and 0 < pitch ≤ 90; raises BadRequest."""
    look_at_deg, pitch_deg = float(angles.look_at_deg), float(angles.pitch_deg)
    if not 0.0 <= look_at_deg < 360.0:
        raise BadRequest(f"look-at angle is {look_at_deg:g}°, expected at least 0 and less than 360 (counter-clockwise from north)")
    if not 0.0 < pitch_deg <= 90.0:
        raise BadRequest(f"pitch is {pitch_deg:g}°, expected more than 0 and at most 90 (90 looks straight down)")
    return ViewAngles(abs(look_at_deg), pitch_deg)


def axes(angles: ViewAngles) -> Axes:
    look_at_deg, pitch_deg = check_angles(angles)
    cos_a, sin_a = cos_sin(look_at_deg)
    cos_p, sin_p = cos_sin(pitch_deg)
    return Axes(
        right=(cos_a, sin_a, 0.0),
        up=(-sin_p * sin_a, sin_p * cos_a, cos_p),
        forward=(-cos_p * sin_a, cos_p * cos_a, -sin_p),
    )


def dot(a: Vec3, b: Vec3) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def uvd_from_local(view: Axes, local: ArrayLike) -> NDArray[np.float64]:
    """Returns (..., 3) view coordinates U, V, D of (..., 3) local positions, metres."""
    x, y, z = _columns(local)
    return np.stack([axis[0] * x + axis[1] * y + axis[2] * z for axis in view], axis=-1)


def local_from_uvd(view: Axes, uvd: ArrayLike) -> NDArray[np.float64]:
    """Returns (..., 3) local positions of (..., 3) view coordinates, metres; the inverse of `uvd_from_local` up to rounding."""
    u, v, d = _columns(uvd)
    return np.stack([u * view.right[k] + v * view.up[k] + d * view.forward[k] for k in range(3)], axis=-1)


def view_id(angles: ViewAngles) -> str:
    """Returns `<look-at>-<pitch>`, each in the shortest decimal form that reads back as the same number."""
    look_at_deg, pitch_deg = check_angles(angles)
    return f"{_shortest(look_at_deg)}-{_shortest(pitch_deg)}"


def track_id(view: str, number: int) -> str:
    """Returns the id of the track of a view and a pass (spec/pyramid.md §8)."""
    return f"{view}+{number}" if number else view


def views_around(directions: int, pitches: Sequence[float]) -> tuple[ViewAngles, ...]:
    """Returns views at evenly spaced look-at angles, counter-clockwise from north; only one at pitch 90, which looks straight down."""
    return tuple(ViewAngles(360.0 * k / directions, pitch) for pitch in pitches for k in range(1 if pitch == 90 else directions))


def parse_view(text: str) -> ViewAngles:
    """Returns the angles of a view that a user wrote as `45-22.5`, `45/22.5`, or `45` with the default pitch. Raises BadRequest."""
    look_at, separator, pitch = text.partition("/" if "/" in text else "-")
    try:
        return check_angles(ViewAngles(float(look_at), float(pitch) if separator else DEFAULT_PITCH_DEG))
    except ValueError as error:
        raise BadRequest(f"view {text[:64]!r}: write look-at angle and pitch in degrees, e.g. 45-22.5 or 45/22.5") from error


def parse_view_id(text: str) -> ViewAngles:
    """Parses a view id; raises BadRequest unless it is exactly as `view_id` writes it."""
    match = _ID.fullmatch(text)
    angles = ViewAngles(float(match[1]), float(match[2])) if match else None
    if angles is None or view_id(angles) != text:
        raise BadRequest(f"view {text[:64]!r}: expected <look-at>-<pitch> in shortest decimal form, e.g. 45-22.5")
    return angles


def _shortest(value: float) -> str:
    return str(int(value)) if value == int(value) else format(Decimal(repr(value)), "f")


def _columns(points: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    array = np.asarray(points, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise BadRequest(f"positions have shape {array.shape}, expected (..., 3 coordinates)")
    return array[..., 0], array[..., 1], array[..., 2]
