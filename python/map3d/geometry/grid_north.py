"""Grid north: the meridian convergence of a projected coordinate system."""

import math
from typing import Final

from pyproj import Geod, Transformer

from map3d.errors import BadRequest
from map3d.geometry.crs import horizontal_crs, parse_crs
from map3d.geometry.sun import GeographicPosition

STEP_M: Final = 100.0
WGS84: Final = "EPSG:4326"


class GridNorth:
    """Converts true azimuths to grid azimuths at one point of a projected coordinate system.

    Takes a step on the ellipsoid in both directions and projects it, so that it works for every projection: also where axes point south or west,
    longitudes count from Paris, or angles are distorted.
    """

    def __init__(self, wkt: str, x: float, y: float) -> None:
        """Raises BadRequest when the point is outside the coordinate system."""
        flat = horizontal_crs(parse_crs(wkt))
        longitude_deg, latitude_deg = Transformer.from_crs(flat, WGS84, always_xy=True).transform(x, y)
        if not (math.isfinite(longitude_deg) and math.isfinite(latitude_deg)):
            raise BadRequest(f"{flat.name} has no point {x:g}, {y:g}: cannot locate the scene, so the sun's position is unknown")
        self.place = GeographicPosition(latitude_deg, longitude_deg)
        self._to_grid = Transformer.from_crs(WGS84, flat, always_xy=True)

    def grid_azimuth_deg(self, azimuth_deg: float) -> float:
        """Returns the azimuth clockwise from +y, 0 ≤ a < 360: the true azimuth less the meridian convergence."""
        ahead, back = self._step(azimuth_deg), self._step(azimuth_deg + 180.0)
        return math.degrees(math.atan2(ahead[0] - back[0], ahead[1] - back[1])) % 360.0

    def _step(self, azimuth_deg: float) -> tuple[float, float]:
        longitude_deg, latitude_deg, _ = Geod(ellps="WGS84").fwd(self.place.longitude_deg, self.place.latitude_deg, azimuth_deg, STEP_M)
        x, y = self._to_grid.transform(longitude_deg, latitude_deg)
        return x, y
