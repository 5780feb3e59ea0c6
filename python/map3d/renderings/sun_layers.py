"""What layers of light need beside their kind: suns and the reach of ambient occlusion."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from datetime import date, datetime
from typing import Final

from map3d.catalogue import SceneRecord
from map3d.errors import BadRequest
from map3d.geometry.sun import Place, SunAngles, hours_of, sun_angles, time_text
from map3d.types import RADIUS_KINDS, Box, Sun, Vec3

ONE_SUN: Final = ("sun", "picture")
DAY: Final = "sun16"
RADIUS_M: Final = 20.0


@dataclass(frozen=True)
class LightRequest:
    """`time` (with its zone) or `sun` (its angles): of the layers sun and picture; `day`: of sun16; `radius_m`: of ambient occlusion, None for the
    usual; `place`: where a scene in local coordinates lies, whose y axis then points north."""

    time: datetime | None = None
    sun: SunAngles | None = None
    day: date | None = None
    radius_m: float | None = None
    place: Place | None = None

    def check(self, kinds: Collection[str], scene: SceneRecord) -> None:
        """Raises BadRequest for what is missing, and for what nothing uses."""
        one, day, radius = any(kind in kinds for kind in ONE_SUN), DAY in kinds, any(kind in kinds for kind in RADIUS_KINDS)
        if one and (self.time is None) == (self.sun is None):
            raise BadRequest(f"{_named(ONE_SUN, kinds)}: say where the sun is, either by --time 2026-06-21T15:00+02:00 or by --sun AZIMUTH,ELEVATION")
        if day and self.day is None:
            raise BadRequest("layer sun16: say of which day, e.g. --date 2026-06-21")
        if self.time is not None and self.time.tzinfo is None:
            raise BadRequest(f"time {self.time.isoformat()}: say of which zone, e.g. {self.time.isoformat()}+02:00, or Z for UTC")
        for given, used, option, kind in (
            (self.time or self.sun, one, "--time and --sun", ONE_SUN),
            (self.day, day, "--date", (DAY,)),
            (self.radius_m, radius, "--ao-radius", RADIUS_KINDS),
        ):
            if given is not None and not used:
                raise BadRequest(f"{option}: of the layers {' and '.join(kind)} only; none of them is asked for")
        self._check_place(scene, needed=day or (one and self.sun is None))
        self._check_sun()

    def suns(self, kind: str, scene: SceneRecord, box: Box) -> tuple[Sun, ...]:
        """Of a layer of that kind, in the middle of the scene's local box. Raises BadRequest for a sun that does not shine."""
        if kind not in (*ONE_SUN, DAY):
            return ()
        ground = Ground(scene, box, self.place)
        if kind == DAY:
            assert self.day is not None, "checked"
            return tuple(ground.sun_at(time) for time in hours_of(ground.place, self.day))
        sun = ground.sun(self.sun) if self.sun is not None else ground.sun_at(self._whole_second())
        if sun.elevation_deg <= 0:
            raise BadRequest(
                f"at {sun.time} the sun is {-sun.elevation_deg:.1f} degrees below the horizon there and lights nothing; choose another --time"
            )
        return (sun,)

    def radius_of(self, kind: str) -> float | None:
        return (RADIUS_M if self.radius_m is None else self.radius_m) if kind in RADIUS_KINDS else None

    def _whole_second(self) -> datetime:
        assert self.time is not None, "checked"
        return self.time.replace(microsecond=0)

    def _check_sun(self) -> None:
        if self.sun is not None and not (0 <= self.sun.azimuth_deg < 360 and 0 < self.sun.elevation_deg <= 90):
            raise BadRequest(f"sun {self.sun.azimuth_deg:g}, {self.sun.elevation_deg:g}: need 0 ≤ azimuth < 360 and 0 < elevation ≤ 90 degrees")

    def _check_place(self, scene: SceneRecord, needed: bool) -> None:
        local = scene.crs is None or scene.crs.is_local
        if self.place is not None:
            self.place.checked()
        if self.place is not None and not local:
            assert scene.crs is not None, "not local"
            raise BadRequest(f"--place: the coordinate system of scene {scene.name}, {scene.crs.name}, says already where it lies; leave --place out")
        if needed and local and self.place is None:
            raise BadRequest(
                f"scene {scene.name} is in local metres: say where it lies with --place LATITUDE,LONGITUDE, or give --sun AZIMUTH,ELEVATION"
            )


class Ground:
    """Where on earth a scene lies, and how its axes lie there."""

    def __init__(self, scene: SceneRecord, box: Box, place: Place | None) -> None:
        """Raises BadRequest when the scene's system cannot tell."""
        from map3d.renderings.grid_north import Grid

        origin = scene.origin or (0.0, 0.0, 0.0)
        x, y = (origin[k] + (box[0][k] + box[1][k]) / 2 for k in (0, 1))
        self._grid = None if scene.crs is None or scene.crs.wkt is None else Grid(scene.crs.wkt, x, y)
        self._place = place if self._grid is None else self._grid.place

    @property
    def place(self) -> Place:
        assert self._place is not None, "checked"
        return self._place

    def sun_at(self, time: datetime) -> Sun:
        return self.sun(sun_angles(self.place, time), time_text(time))

    def sun(self, angles: SunAngles, time: str | None = None) -> Sun:
        azimuth_deg = angles.azimuth_deg if self._grid is None else self._grid.grid_azimuth_deg(angles.azimuth_deg)
        return Sun(time, *angles, _direction(azimuth_deg, angles.elevation_deg))


def _direction(azimuth_deg: float, elevation_deg: float) -> Vec3:
    """Unit vector; azimuth clockwise from +y."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e))


def _named(kinds: Collection[str], among: Collection[str]) -> str:
    return "layer " + " and ".join(kind for kind in kinds if kind in among)
