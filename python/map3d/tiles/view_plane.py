"""The CRS of the plane of a manifest's view (map3d.geometry.view_plane_crs)."""

from functools import lru_cache

from pyproj import CRS

from map3d.errors import CrsError
from map3d.geometry.crs import parse_crs
from map3d.geometry.frames import PinnedFrame
from map3d.geometry.view_plane_crs import view_plane_crs
from map3d.tiles.manifest import Manifest, ManifestCrs, ManifestView
from map3d.types import Vec3


def reference_height_m(manifest: Manifest) -> float:
    """Returns the height of the lowest content in the scene's CRS: the ground of a flat town."""
    return manifest.origin[2] + manifest.box[0][2]


def plane_crs(manifest: Manifest, view: ManifestView, height_m: float | None = None) -> CRS:
    """Returns the CRS of a view's plane for ground points at a height, by default `reference_height_m`; for a scene with local coordinates, or a CRS
    without easting and northing, an engineering CRS with the same coordinates. Raises BadRequest for a height out of range."""
    height_m = reference_height_m(manifest) if height_m is None else height_m
    name = f"map3d {manifest.name}: plane of view {view.frame.id} for height {height_m:g} m"
    return _plane_crs(manifest.crs, view.frame, manifest.origin, height_m, name)


def scene_crs(crs: ManifestCrs) -> CRS | None:
    """Returns None for local coordinates."""
    name = f"EPSG:{crs.epsg}" if crs.epsg is not None else crs.wkt
    return None if name is None else parse_crs(name)


@lru_cache(maxsize=256)
def _plane_crs(crs: ManifestCrs, frame: PinnedFrame, origin: Vec3, height_m: float, name: str) -> CRS:
    try:
        return view_plane_crs(frame, origin, scene_crs(crs), height_m, name)
    except CrsError:
        return view_plane_crs(frame, origin, None, height_m, name)
