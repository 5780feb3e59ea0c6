"""The CRS of a scene: projected in metres of the place where it lies, or local metres."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Geod, Transformer
from pyproj.aoi import AreaOfInterest
from pyproj.database import query_utm_crs_info

from map3d.catalogue import SceneCrs, SceneRecord
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.errors import CrsError
from map3d.geometry.area_of_use import AreaOfUse
from map3d.geometry.crs import horizontal_crs, is_local, is_metric, parse_crs, vertical_crs_name
from map3d.geometry.places import Place, find_place
from map3d.ingest.axis_order import METRES_PER_DEGREE, is_north_first
from map3d.types import Vec3

Points = NDArray[np.float64]

MAX_LENGTH_ERROR: Final = 1e-3
"""A CRS whose lengths differ more from those on the ground at a place is none for a scene there."""
STEP_M: Final = 1000.0
WHOLE_EARTH_DEG: Final = 359.0
STRAY_TIMES: Final = 8.0
USUAL_PERCENT: Final = 90.0

LOCAL: Final = SceneCrs(None, None, LOCAL_CRS_NAME)


def parse_scene_crs(text: str) -> SceneCrs:
    """Parses the user's name of a scene's CRS, which may be "local". Raises CrsError unless projected in metres, and for one of the whole Earth,
    whose metres are longer than those on the ground."""
    if is_local(text):
        return LOCAL
    crs = parse_crs(text)
    area = horizontal_crs(crs).area_of_use
    if is_metric(crs) and area is not None and area.east - area.west >= WHOLE_EARTH_DEG:
        raise CrsError(f"{crs.name} is for maps of the whole Earth, its metres are not those on the ground; choose e.g. the UTM zone of the place")
    return to_scene_crs(crs)


def scene_place(scene: SceneRecord, point: Vec3 | None) -> Place | None:
    """Returns where on Earth a point in world coordinates of a scene is, or its origin; None in local metres, without an origin, and where the CRS
    does not reach."""
    point = scene.origin if point is None else point
    if scene.crs is None or scene.crs.wkt is None or point is None:
        return None
    lon, lat = Transformer.from_crs(horizontal_crs(parse_crs(scene.crs.wkt)), "EPSG:4326", always_xy=True).transform(*point[:2])
    return find_place(lon, lat) if abs(lon) <= 360.0 and abs(lat) <= 90.0 else None


def to_scene_crs(crs: CRS) -> SceneCrs:
    """Converts to the form that the catalogue stores. Raises CrsError unless projected in metres."""
    if not is_metric(crs):
        raise CrsError(f"{crs.name}: a scene needs a projected CRS in metres; choose one with --crs, e.g. the UTM zone of the place")
    horizontal = horizontal_crs(crs)
    whole = crs if crs.is_compound else horizontal
    return SceneCrs(
        epsg=horizontal.to_epsg(min_confidence=100), wkt=whole.to_wkt("WKT2_2019"), name=str(horizontal.name), vertical=vertical_crs_name(crs)
    )


def choose_scene_crs(source: CRS, points: Points, middle: NDArray[np.float64] | None = None) -> CRS:
    """Chooses the scene's CRS by its first asset: the asset's own if projected in metres that are metres at the place, else the UTM zone of its
    centre.

    `points`: (n, 3) in the order of the CRS, east first if projected; `middle`: (2,) where the file lies, by default the median of the points. Points
    far from it do not count. Raises CrsError.
    """
    horizontal = horizontal_crs(source)
    finite = points[np.isfinite(points).all(axis=1), :2]
    if middle is None and len(finite):
        middle = np.median(finite, axis=0)
    if middle is None:
        if is_metric(source):
            return source
        raise CrsError("cannot choose a UTM zone: the file has no finite coordinates; set the scene's CRS with --crs")
    near = finite[_near(finite, middle, 1.0 if horizontal.is_geographic else METRES_PER_DEGREE)]
    centre = (near.min(axis=0) + near.max(axis=0)) / 2 if len(near) else middle
    x, y = centre[::-1] if horizontal.is_geographic and is_north_first(horizontal) else centre
    lon, lat = Transformer.from_crs(horizontal, 4326, always_xy=True).transform(x, y)
    is_on_earth = bool(-180 <= lon <= 180 and -80 <= lat <= 84)
    if is_metric(source) and not (is_on_earth and stretches(source, lon, lat)):
        return source
    if not is_on_earth:
        raise CrsError(
            f"longitude {lon:g}, latitude {lat:g} is outside all UTM zones; set the scene's CRS with --crs, or the file's if its own is wrong"
        )
    return _find_utm_zone(horizontal, lon, lat)


def stretches(crs: CRS, lon: float, lat: float) -> bool:
    """Whether metres of a projected CRS are none at a place, in degrees, for which it is meant."""
    area = AreaOfUse.of(horizontal_crs(crs))
    return (area is None or area.contains(lon, lat)) and abs(length_error(crs, lon, lat)) > MAX_LENGTH_ERROR


def length_error(crs: CRS, lon: float, lat: float) -> float:
    """Returns by which part lengths in a projected CRS are longer than on the ground at a place in degrees, along the axis where that is most;
    infinite where the CRS does not reach."""
    horizontal = horizontal_crs(crs)
    ahead = [Geod(ellps="WGS84").fwd(lon, lat, azimuth, STEP_M)[:2] for azimuth in (0.0, 90.0)]
    x, y = Transformer.from_crs("EPSG:4326", horizontal, always_xy=True).transform([lon, *(p[0] for p in ahead)], [lat, *(p[1] for p in ahead)])
    unit_m = horizontal.axis_info[0].unit_conversion_factor
    errors = [math.hypot(x[k] - x[0], y[k] - y[0]) * unit_m / STEP_M - 1.0 for k in (1, 2)]
    return max(errors, key=abs) if all(map(math.isfinite, errors)) else math.inf


def _near(points: Points, middle: NDArray[np.float64], least: float) -> NDArray[np.bool_]:
    """Returns which points lie within some times their usual spread from the middle, or `least`, along each axis."""
    if not len(points):
        return np.zeros(0, dtype=np.bool_)
    spread = np.percentile(np.abs(points - np.median(points, axis=0)), USUAL_PERCENT, axis=0)
    return np.asarray((np.abs(points - middle) <= np.maximum(least, STRAY_TIMES * spread)).all(axis=1))


def _find_utm_zone(horizontal: CRS, lon: float, lat: float) -> CRS:
    """Prefers the zone on the datum of `horizontal`, else takes the one on WGS 84."""
    point = AreaOfInterest(lon, lat, lon, lat)
    datum = horizontal.geodetic_crs.name if horizontal.geodetic_crs is not None else None
    zones = query_utm_crs_info(datum_name=datum, area_of_interest=point) or query_utm_crs_info(datum_name="WGS 84", area_of_interest=point)
    plain = [zone for zone in zones if zone.name.startswith(f"{datum} / UTM zone") and not zone.name.endswith(")")] or zones
    return CRS.from_epsg(int(min(plain, key=lambda zone: int(zone.code)).code))
