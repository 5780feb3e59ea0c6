"""What explains that objects are not on the ground: heights of 0, in another unit, or above another surface."""

from collections.abc import Callable
from typing import Final

import numpy as np

from map3d.coherence.height_units import FOOT_M
from map3d.coherence.surveyed_assets import Floats
from map3d.geometry.geoid import ACCURACY_M

TOLERANCE_M: Final = 10.0
DEVIATIONS: Final = 4.0
"""Objects contradict the ground if the median of their distances from it exceeds both."""
AT_ZERO_M: Final = 0.01
LEAST_GEOID_M: Final = 18.0
FEET_SHARE: Final = 0.02

GeoidHeight = Callable[[], float | None]
"""Returns the geoid above the ellipsoid in metres, None if unknown."""

GROUND_KINDS: Final = ("terrain-in-feet", "terrain-ellipsoidal")
"""Kinds by which the ground is wrong, not the objects."""


def find_kind(base: Floats, ground: Floats, *, is_guessed: bool, geoid: GeoidHeight) -> str:
    """Returns the kind of contradiction, which is the code of its message: constant distances are heights of another kind, others another unit.

    `base`, `ground`: (n,) heights of objects and of the ground below them; `is_guessed`: whether the unit of the objects' heights is that of their
    plane for want of anything better.
    """
    if are_zero(base):
        return "heights-at-zero"
    metres, deviation = robust_middle(base - ground)
    by_geoid = _kind_by_geoid(metres, geoid()) if deviation <= TOLERANCE_M / 2 else None
    by_unit = _kind_by_unit(base, ground, deviation, is_guessed=is_guessed)
    found = (by_unit or by_geoid) if is_guessed else (by_geoid or by_unit)
    return found or ("heights-below-terrain" if metres < 0 else "heights-above-terrain")


def are_zero(base: Floats) -> bool:
    return bool(np.quantile(np.abs(base), 0.95) <= AT_ZERO_M)


def robust_middle(values: Floats) -> tuple[float, float]:
    """Returns the median, and the deviation from it that a normal distribution would have."""
    middle = float(np.median(values))
    return middle, 1.4826 * float(np.median(np.abs(values - middle)))


def _kind_by_unit(base: Floats, ground: Floats, deviation: float, *, is_guessed: bool) -> str | None:
    own = ("heights-in-metres", base / FOOT_M - ground) if is_guessed else ("heights-in-feet", base * FOOT_M - ground)
    for kind, fitted in (own, ("terrain-in-feet", base - ground * FOOT_M)):
        middle, spread = robust_middle(fitted)
        if abs(middle) <= max(TOLERANCE_M / 2, FEET_SHARE * float(np.median(np.abs(ground)))) and spread <= max(deviation, TOLERANCE_M / 2):
            return kind
    return None


def _kind_by_geoid(metres: float, geoid_m: float | None) -> str | None:
    if geoid_m is None or abs(geoid_m) < LEAST_GEOID_M:
        return None
    both = (("heights-ellipsoidal", metres - geoid_m), ("terrain-ellipsoidal", metres + geoid_m))
    return next((kind for kind, away in both if abs(away) <= ACCURACY_M), None)
