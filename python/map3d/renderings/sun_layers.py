"""Parameters of sun and ambient occlusion layers: the suns and the radius."""

import math
from collections.abc import Collection
from datetime import datetime
from typing import Final

from map3d.catalogue import SceneRecord
from map3d.errors import BadRequest
from map3d.geometry.sun import GeographicPosition, SunAngles, hours_of, sun_angles, time_text
from map3d.requests.renderings import DEFAULT_RADIUS_M, LayerDetails
from map3d.types import LAYERS, RADIUS_KINDS, Box, Sun, Vec3

ONE_SUN: Final = tuple(kind for kind, row in LAYERS.items() if row.suns == (1, 1))
DAY: Final = tuple(kind for kind, row in LAYERS.items() if row.suns[1] > 1)
"""Kinds with the suns of a day."""


def check_light(light: LayerDetails, kinds: Collection[str], scene: SceneRecord) -> None:
    """Raises BadRequest for missing options and for options that no layer of `kinds` uses."""
    one, day, radius = (any(kind in kinds for kind in those) for those in (ONE_SUN, DAY, RADIUS_KINDS))
    if one and (light.time is None) == (light.sun is None):
        raise BadRequest(f"{_named(ONE_SUN, kinds)}: give the sun either as --time 2026-06-21T15:00+02:00 or as --sun AZIMUTH,ELEVATION")
    if day and light.day is None:
        raise BadRequest(f"{_named(DAY, kinds)}: missing day; give it as in --date 2026-06-21")
    if light.time is not None and light.time.tzinfo is None:
        raise BadRequest(f"time {light.time.isoformat()}: missing time zone; write e.g. {light.time.isoformat()}+02:00, or Z for UTC")
    for given, used, option, kind in (
        (light.time or light.sun, one, "--time and --sun", ONE_SUN),
        (light.day, day, "--date", DAY),
        (light.radius_m, radius, "--ao-radius", RADIUS_KINDS),
    ):
        if given is not None and not used:
            raise BadRequest(f"{option}: used only by {' and '.join(kind)}; add such a layer to --layers, or leave the option out")
    _check_place(light, scene, needed=day or (one and light.sun is None))
    _check_sun(light)


def suns_of(light: LayerDetails, kind: str, scene: SceneRecord, box: Box) -> tuple[Sun, ...]:
    """Returns the suns of a layer of this kind, for the centre of the scene's local box. Raises BadRequest for a sun below the horizon."""
    if kind not in (*ONE_SUN, *DAY):
        return ()
    location = SceneLocation(scene, box, light.place)
    if kind in DAY:
        assert light.day is not None, "checked"
        return tuple(location.sun_at(time) for time in hours_of(location.place, light.day))
    sun = location.sun(light.sun) if light.sun is not None else location.sun_at(_whole_second(light))
    if sun.elevation_deg <= 0:
        raise BadRequest(f"at {sun.time} the sun is {-sun.elevation_deg:.1f} degrees below the horizon; choose another --time")
    return (sun,)


def radius_of(light: LayerDetails, kind: str) -> float | None:
    return (DEFAULT_RADIUS_M if light.radius_m is None else light.radius_m) if kind in RADIUS_KINDS else None


def _whole_second(light: LayerDetails) -> datetime:
    assert light.time is not None, "checked"
    return light.time.replace(microsecond=0)


def _check_sun(light: LayerDetails) -> None:
    if light.sun is not None and not (0 <= light.sun.azimuth_deg < 360 and 0 < light.sun.elevation_deg <= 90):
        raise BadRequest(f"sun {light.sun.azimuth_deg:g}, {light.sun.elevation_deg:g}: expected 0 ≤ azimuth < 360 and 0 < elevation ≤ 90 degrees")


def _check_place(light: LayerDetails, scene: SceneRecord, needed: bool) -> None:
    local = scene.crs is None or scene.crs.is_local
    if light.place is not None:
        light.place.checked()
    if light.place is not None and not local:
        assert scene.crs is not None, "not local"
        raise BadRequest(f"--place: scene {scene.name} is already located by its coordinate system {scene.crs.name}; leave --place out")
    if needed and local and light.place is None:
        raise BadRequest(
            f"scene {scene.name} is in local metres: give its position as --place LATITUDE,LONGITUDE, or the sun as --sun AZIMUTH,ELEVATION"
        )


class SceneLocation:
    """The position of a scene on earth and the orientation of its axes."""

    def __init__(self, scene: SceneRecord, box: Box, place: GeographicPosition | None) -> None:
        """Raises BadRequest when the scene's coordinate system does not cover its position."""
        from map3d.geometry.grid_north import GridNorth

        origin = scene.origin or (0.0, 0.0, 0.0)
        x, y = (origin[k] + (box[0][k] + box[1][k]) / 2 for k in (0, 1))
        self._grid = None if scene.crs is None or scene.crs.wkt is None else GridNorth(scene.crs.wkt, x, y)
        self._place = place if self._grid is None else self._grid.place

    @property
    def place(self) -> GeographicPosition:
        assert self._place is not None, "checked"
        return self._place

    def sun_at(self, time: datetime) -> Sun:
        return self.sun(sun_angles(self.place, time), time_text(time))

    def sun(self, angles: SunAngles, time: str | None = None) -> Sun:
        azimuth_deg = angles.azimuth_deg if self._grid is None else self._grid.grid_azimuth_deg(angles.azimuth_deg)
        return Sun(time, *angles, _direction(azimuth_deg, angles.elevation_deg))


def _direction(azimuth_deg: float, elevation_deg: float) -> Vec3:
    """Returns the unit vector; the azimuth is clockwise from +y."""
    a, e = math.radians(azimuth_deg), math.radians(elevation_deg)
    return (math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e))


def _named(kinds: Collection[str], requested: Collection[str]) -> str:
    return "layer " + " and ".join(kind for kind in kinds if kind in requested)
