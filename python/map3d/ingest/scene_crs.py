"""The CRS of a scene: projected in metres, or local metres."""

from typing import Final

from pyproj import CRS

from map3d.catalogue import SceneCrs
from map3d.catalogue.records import LOCAL_CRS_NAME
from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, is_local, is_metric, parse_crs, vertical_crs_name

LOCAL: Final = SceneCrs(None, None, LOCAL_CRS_NAME)


def parse_scene_crs(text: str) -> SceneCrs:
    """Parses the user's name of a scene's CRS, which may be "local". Raises CrsError unless projected in metres."""
    return LOCAL if is_local(text) else to_scene_crs(parse_crs(text))


def to_scene_crs(crs: CRS) -> SceneCrs:
    """Converts to the form that the catalogue stores. Raises CrsError unless projected in metres."""
    if not is_metric(crs):
        raise CrsError(f"{crs.name}: a scene needs a projected CRS in metres; choose one with --crs, e.g. the UTM zone of the place")
    horizontal = horizontal_crs(crs)
    whole = crs if crs.is_compound else horizontal
    return SceneCrs(
        epsg=horizontal.to_epsg(min_confidence=100), wkt=whole.to_wkt("WKT2_2019"), name=str(horizontal.name), vertical=vertical_crs_name(crs)
    )
