"""Where a grid's point lies on earth, and how true directions run in the grid there."""

import math
from typing import Final

from pyproj import Geod, Transformer

from map3d.errors import BadRequest
from map3d.geometry.sun import Place
from map3d.ingest.crs import horizontal, parse_crs

STEP_M: Final = 100.0
WGS84: Final = "EPSG:4326"


class Grid:
    """A projected system around one of its points.

    A direction is looked up by a step that way and one back, which holds for every projection: also where axes point south and west, longitudes count
    from Paris, or angles are not kept.
    """

    def __init__(self, wkt: str, x: float, y: float) -> None:
        """Raises BadRequest where the system has no such point."""
        flat = horizontal(parse_crs(wkt))
        longitude_deg, latitude_deg = Transformer.from_crs(flat, WGS84, always_xy=True).transform(x, y)
        if not (math.isfinite(longitude_deg) and math.isfinite(latitude_deg)):
            raise BadRequest(f"{flat.name} has no point {x:g}, {y:g}: where the scene lies is not known, so the sun over it is neither")
        self.place = Place(latitude_deg, longitude_deg)
        self._to_grid = Transformer.from_crs(WGS84, flat, always_xy=True)

    def grid_azimuth_deg(self, azimuth_deg: float) -> float:
        """Clockwise from +y, 0 ≤ a < 360, of an azimuth from true north: less by the meridian convergence."""
        ahead, back = self._step(azimuth_deg), self._step(azimuth_deg + 180.0)
        return math.degrees(math.atan2(ahead[0] - back[0], ahead[1] - back[1])) % 360.0

    def _step(self, azimuth_deg: float) -> tuple[float, float]:
        longitude_deg, latitude_deg, _ = Geod(ellps="WGS84").fwd(self.place.longitude_deg, self.place.latitude_deg, azimuth_deg, STEP_M)
        x, y = self._to_grid.transform(longitude_deg, latitude_deg)
        return x, y
