"""Checks that rasters lie where their CRS, or the lack of one, says: near the scene's content and inside the CRS's area of use."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from pyproj import CRS

from map3d.errors import CrsError
from map3d.geometry.crs import is_local
from map3d.geometry.places import Place, find_place
from map3d.ingest.coordinate_check import CoordinateCheck
from map3d.ingest.findings import finding
from map3d.ingest.terrain.raster_georeference import open_raster, own_crs

NEAR_M: Final = 10_000.0
MAX_DEGREE_PIXEL: Final = 0.01
"""Rasters in degrees have smaller pixels than rasters in metres."""


class RasterPlacement:
    """Collects what is odd about the rasters of one terrain. `place`: that of the first raster with a CRS."""

    def __init__(self, stated_crs: str | None, scene_crs: str | None, scene_origin: Sequence[float] | None) -> None:
        """`stated_crs`: the user's choice; `scene_crs`: WKT, "local", or None while the scene has no CRS; `scene_origin`: near its content."""
        self._stated, self._origin = stated_crs, scene_origin
        self._scene_is_local = scene_crs is not None and is_local(scene_crs)
        self._scene = None if scene_crs is None or self._scene_is_local else CRS.from_user_input(scene_crs)
        self.findings: list[dict[str, Any]] = []
        self.place: Place | None = None

    def check(self, path: Path) -> None:
        """Raises CrsError for a raster that cannot lie where it would be put."""
        with open_raster(path) as raster:
            own = own_crs(raster, self._stated)
            bounds, pixel = raster.bounds, max(map(abs, raster.res))
        if own is not None and not own.is_geographic and self._scene_is_local:
            words = f"its CRS is {own.name}, but the scene is in local metres, where"
            advice = f"; if models have an origin of their own, say where it lies with --crs {_code(own)} --offset X,Y,Z"
            self._check_distance(path, bounds, words, advice)
            self._warn(
                "raster-crs-not-used",
                f"{path.name}; import the other files with --crs to give the scene a CRS, e.g. --crs {_code(own)}",
            )
        elif own is not None:
            self._check_area(path, own, bounds)
        elif self._stated is None:
            self._check_without_crs(path, bounds, pixel)
        elif self._scene_is_local:
            away = self._distance_m(bounds)
            if away:
                self._warn("raster-far-from-scene", f"{path.name} lies {away / 1000:,.0f} km from it")

    def _check_without_crs(self, path: Path, bounds: Any, pixel: float) -> None:
        x, y = (bounds.left + bounds.right) / 2, (bounds.bottom + bounds.top) / 2
        if pixel <= MAX_DEGREE_PIXEL and abs(x) <= 180.0 and abs(y) <= 90.0:
            raise CrsError(
                f"{path}: the raster has no CRS, and its coordinates look like degrees {find_place(x, y)}; "
                "give --crs OGC:CRS84 to read them as degrees, or --crs local for plain metres"
            )
        if self._scene is not None:
            self._check_distance(path, bounds, f"without a CRS of its own, with the scene's ({self._scene.name})")
        elif not self._scene_is_local:
            self._warn("raster-read-as-local", f"{path.name}; name its CRS with --crs, e.g. --crs EPSG:25832")

    def _check_area(self, path: Path, own: CRS, bounds: Any) -> None:
        columns = [1, 0, 2] if own.is_geographic and own.axis_info[0].direction == "north" else [0, 1, 2]
        corners = np.array([(x, y, 0.0) for x in (bounds.left, bounds.right) for y in (bounds.bottom, bounds.top)])
        check = CoordinateCheck(own, self._stated or "", stated=True, axes_known=True)
        try:
            check.ordered(corners[:, columns])
        except CrsError as error:
            raise CrsError(f"{path}: {error}") from error
        self.place = self.place or check.place
        for found in check.findings:
            self.findings.append({**found, "code": "raster-outside-area-of-use", "example": f"{path.name}: {found['example']}"})

    def _check_distance(self, path: Path, bounds: Any, words: str, advice: str = "") -> None:
        away = self._distance_m(bounds)
        if away:
            raise CrsError(
                f"{path}: {words} the raster lies {away / 1000:,.0f} km from the scene's content; "
                f"name the CRS of the raster or of the other files with --crs, or leave the raster out{advice}"
            )

    def _distance_m(self, bounds: Any) -> float:
        """Returns the distance to the scene's origin; 0 if the raster's box, grown by its own size and NEAR_M, contains it."""
        if self._origin is None:
            return 0.0
        margin = NEAR_M + max(bounds.right - bounds.left, bounds.top - bounds.bottom)
        x, y = self._origin[:2]
        away = float(np.hypot(max(bounds.left - x, x - bounds.right, 0.0), max(bounds.bottom - y, y - bounds.top, 0.0)))
        return away if away > margin else 0.0

    def _warn(self, code: str, example: str) -> None:
        for found in self.findings:
            if found["code"] == code:
                found["count"] += 1
                return
        self.findings.append(finding(code, 1, example))


def _code(crs: CRS) -> str:
    code = (crs.sub_crs_list[0] if crs.is_compound else crs).to_epsg()
    return f"EPSG:{code}" if code else "EPSG:25832"
