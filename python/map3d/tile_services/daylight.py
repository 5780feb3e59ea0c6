"""The light of a picture: the viewer's default light, or sun and sky at a time and place, with the viewer's colours."""

import re
from datetime import UTC, datetime
from itertools import pairwise
from typing import Final

from map3d.errors import BadRequest
from map3d.geometry.grid_north import GridNorth
from map3d.geometry.sun import sun_angles
from map3d.tiles.light_colors import WHITE, PictureLight, direction
from map3d.tiles.manifest import Manifest
from map3d.types import Vec3

_TIME: Final = re.compile(r"[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}Z", re.ASCII)
_YEARS: Final = range(1900, 2101)

ColorStops = tuple[tuple[float, Vec3], ...]
"""Colours by the sun's elevation in degrees, ascending; linear in between."""
SUN: Final[ColorStops] = ((-1, (0, 0, 0)), (0.5, (0.42, 0.17, 0.06)), (4, (0.92, 0.58, 0.3)), (12, (1.04, 0.88, 0.68)), (30, WHITE))
SKY: Final[ColorStops] = ((-12, (0.44, 0.5, 0.7)), (-6, (0.48, 0.54, 0.72)), (0, (0.6, 0.62, 0.74)), (8, (0.9, 0.93, 1)), (30, WHITE))
"""Those of the viewer: viewer/src/geo/daylight.ts."""


def parse_time(text: str) -> datetime:
    """Parses a time in UTC to the minute, such as `2026-06-21T12:00Z`. Raises BadRequest."""
    time = None
    if _TIME.fullmatch(text):
        try:
            time = datetime.strptime(text, "%Y-%m-%dT%H:%MZ").replace(tzinfo=UTC)
        except ValueError:
            time = None
    if time is None or time.year not in _YEARS:
        raise BadRequest(f"{text[:30]!r} is not a time; expected YYYY-MM-DDThh:mmZ, in UTC, {_YEARS[0]} to {_YEARS[-1]}")
    return time


def time_text(time: datetime) -> str:
    return time.strftime("%Y-%m-%dT%H:%MZ")


def light_at(manifest: Manifest, time: datetime) -> PictureLight:
    """Returns sun and sky over the scene's centre. Raises BadRequest for a scene whose place on Earth is unknown."""
    if manifest.geographic is None or manifest.crs.wkt is None:
        raise BadRequest(f"rendering {manifest.name!r} has no known place on Earth, so the sun's position is unknown; leave out t")
    (x, y), (origin_x, origin_y, _) = manifest.geographic.local, manifest.origin
    north = GridNorth(manifest.crs.wkt, origin_x + x, origin_y + y)
    sun = sun_angles(north.place, time)
    towards = direction(north.grid_azimuth_deg(sun.azimuth_deg), sun.elevation_deg)
    return PictureLight(towards, _color(SUN, sun.elevation_deg), _color(SKY, sun.elevation_deg))


def _color(stops: ColorStops, elevation_deg: float) -> Vec3:
    if elevation_deg <= stops[0][0]:
        return stops[0][1]
    for (low, before), (high, after) in pairwise(stops):
        if elevation_deg <= high:
            share = (elevation_deg - low) / (high - low)
            r, g, b = (a + (z - a) * share for a, z in zip(before, after, strict=True))
            return (r, g, b)
    return stops[-1][1]
