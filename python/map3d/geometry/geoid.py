"""How far the geoid is above the ellipsoid, within about 15 m: enough to recognise heights of one kind beside heights of the other."""

import math
from collections.abc import Mapping
from typing import Final

DEGREE: Final = 8
ACCURACY_M: Final = 15.0
_EARTH_M: Final = 6_371_000.0
_FLATTENING: Final = 1 / 298.257223563

_POTENTIAL: Final[Mapping[int, tuple[tuple[float, float], ...]]] = {
    2: ((-484165.37, 0), (-0.19, 1.2), (2439.14, -1400.17)),
    3: ((957.25, 0), (2029.99, 248.51), (904.63, -619.03), (721.07, 1414.36)),
    4: ((539.87, 0), (-536.32, -473.44), (350.69, 662.67), (990.77, -200.93), (-188.56, 308.85)),
    5: ((68.53, 0), (-62.1, -94.42), (652.44, -323.35), (-451.96, -214.85), (-295.3, 49.67), (174.97, -669.38)),
    6: ((-149.96, 0), (-76.09, 26.29), (48.17, -373.73), (57.17, 9.03), (-86.21, -471.41), (-267.13, -536.49), (9.68, -237.19)),
    7: ((90.98, 0), (279.87, 95.43), (329.74, 93.07), (250.4, -217.2), (-275.11, -123.8), (1.94, 17.74), (-358.86, 151.79), (1.09, 24.44)),
    8: (
        (49.67, 0),
        (23.34, 59.01),
        (80.3, 65.42),
        (-19.19, -86.35),
        (-244.6, 70.02),
        (-25.54, 89.15),
        (-65.74, 309.24),
        (67.28, 74.74),
        (-124.09, 120.53),
    ),
}
"""Degree → the normalised coefficients C and S of the orders 0, 1, …, in 1e-9: EGM96 (Lemoine et al. 1998)."""

_NORMAL: Final = {2: -484166.77, 4: 790.3, 6: -1.69}
"""Degree → the zonal coefficient of the ellipsoid of WGS 84, in 1e-9."""


def geoid_above_ellipsoid_m(lon_deg: float, lat_deg: float) -> float:
    """Returns the undulation of the geoid above the ellipsoid of WGS 84, by the long waves of EGM96; within `ACCURACY_M`."""
    latitude = math.atan((1 - _FLATTENING) ** 2 * math.tan(math.radians(lat_deg)))
    legendre, lon = _legendre(math.sin(latitude), math.cos(latitude)), math.radians(lon_deg)
    total = 0.0
    for n, row in _POTENTIAL.items():
        for m, (c, s) in enumerate(row):
            zonal = _NORMAL.get(n, 0.0) if m == 0 else 0.0
            total += ((c - zonal) * math.cos(m * lon) + s * math.sin(m * lon)) * legendre[n, m]
    return _EARTH_M * 1e-9 * total


def _legendre(t: float, u: float) -> dict[tuple[int, int], float]:
    """Returns (degree, order) → normalised associated Legendre function of the sine `t` and cosine `u` of the latitude (forward columns: Holmes and
    Featherstone 2002)."""
    out = {(0, 0): 1.0}
    for m in range(1, DEGREE + 1):
        out[m, m] = u * math.sqrt((2 * m + 1) / (2 * m) if m > 1 else 3.0) * out[m - 1, m - 1]
    for m in range(DEGREE + 1):
        for n in range(m + 1, DEGREE + 1):
            a = math.sqrt((2 * n + 1) * (2 * n - 1) / ((n - m) * (n + m)))
            out[n, m] = a * t * out[n - 1, m]
            if n - 2 >= m:
                b = math.sqrt((2 * n + 1) * (n + m - 1) * (n - m - 1) / ((n - m) * (n + m) * (2 * n - 3)))
                out[n, m] -= b * out[n - 2, m]
    return out
