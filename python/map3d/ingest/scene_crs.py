"""The CRS of a scene: projected in metres, or local metres."""

from typing import Final

from pyproj import CRS, Transformer

from map3d.catalogue import SceneCrs, SceneRecord
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, is_local, is_metric, parse_crs, vertical_crs_name
from map3d.geometry.places import Place, find_place
from map3d.types import Vec3

LOCAL: Final = SceneCrs(None, None, LOCAL_CRS_NAME)


def parse_scene_crs(text: str) -> SceneCrs:
    """Parses the user's name of a scene's CRS, which may be "local". Raises CrsError unless projected in metres."""
    return LOCAL if is_local(text) else to_scene_crs(parse_crs(text))


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
