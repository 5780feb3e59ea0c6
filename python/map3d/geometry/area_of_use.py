"""The area for which a CRS is meant, with a margin: official data often exceed it a little, e.g. all of Bavaria in UTM zone 32."""

from dataclasses import dataclass
from typing import Final, Self

import numpy as np
from pyproj import CRS, Transformer

MIN_MARGIN_DEG: Final = 0.5
MAX_MARGIN_DEG: Final = 3.0
EDGE_POINTS: Final = 21


@dataclass(frozen=True)
class AreaOfUse:
    """Degrees, WGS 84, margin included. `east` is greater than 180 if the area crosses the antimeridian."""

    west: float
    south: float
    east: float
    north: float

    @classmethod
    def of(cls, horizontal: CRS) -> Self | None:
        """Returns None for a CRS that does not state its area, or whose area is the whole Earth."""
        code = None if horizontal.area_of_use is not None else horizontal.to_epsg()
        stated = horizontal.area_of_use if code is None else CRS.from_epsg(code).area_of_use
        if stated is None:
            return None
        west, south, east, north = stated.bounds
        east += 360.0 * (east < west)
        if east - west >= 359.0:
            return None
        x, y = _margin(east - west), _margin(north - south)
        return cls(west - x, max(south - y, -90.0), east + x, min(north + y, 90.0))

    def contains(self, lon: float, lat: float) -> bool:
        return self.south <= lat <= self.north and (lon - self.west) % 360.0 <= self.east - self.west

    def source_box(self, horizontal: CRS) -> tuple[float, float, float, float] | None:
        """Returns (west, south, east, north) of the area in the CRS, x before y; None where the projection does not reach all of it."""
        transformer = Transformer.from_crs("EPSG:4326", horizontal, always_xy=True)
        box = transformer.transform_bounds(self.west, self.south, min(self.east, 180.0), self.north, densify_pts=EDGE_POINTS)
        return (box[0], box[1], box[2], box[3]) if np.isfinite(box).all() and self.east <= 180.0 else None


def _margin(extent_deg: float) -> float:
    return min(max(extent_deg / 2, MIN_MARGIN_DEG), MAX_MARGIN_DEG)
