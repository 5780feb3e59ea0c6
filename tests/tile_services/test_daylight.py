"""The light of pictures at a time: that of the viewer, at the place of the scene."""

import json
import math
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from map3d.errors import BadRequest
from map3d.geometry.crs import parse_crs
from map3d.tile_services import daylight
from map3d.tile_services.daylight import light_at, parse_time
from map3d.tile_services.picture_request import parse_link, parse_picture
from map3d.tiles.light_colors import DEFAULT_LIGHT, PictureLight, light_colors
from map3d.tiles.manifest import Geographic
from map3d.types import Layer
from tests.tile_services.test_picture import MANIFEST, SIZE, WHERE
from tests.web.test_pictures import VIEW

ZEROS = (0.0,) * 3
PLACED = replace(
    MANIFEST,
    crs=replace(MANIFEST.crs, name="UTM zone 32N", epsg=25832, wkt=parse_crs("EPSG:25832").to_wkt()),
    geographic=Geographic((100.0, 100.0), (11.57, 48.14), 1000.0, 0.01, 1, (ZEROS, ZEROS), (ZEROS, ZEROS), 0.1),
)
VIEWER = Path(__file__).parents[2] / "viewer" / "src" / "geo" / "daylight.ts"


def utc(text: str) -> datetime:
    return datetime.fromisoformat(text).replace(tzinfo=UTC)


def elevation_deg(light: PictureLight) -> float:
    return math.degrees(math.asin(light.towards[2]))


def azimuth_deg(light: PictureLight) -> float:
    return math.degrees(math.atan2(light.towards[0], light.towards[1])) % 360


@pytest.mark.parametrize("name", ["SUN", "SKY"])
def test_the_colours_are_those_of_the_viewer(name):
    (text,) = re.findall(rf"const {name}: readonly ColorStop\[\] = (\[.*?\n\]);", VIEWER.read_text(), re.DOTALL)
    stops = json.loads(re.sub(r",\s*\]", "]", text.replace("WHITE", "[1, 1, 1]")))
    assert [[elevation, list(color)] for elevation, color in getattr(daylight, name)] == stops


def test_the_sun_stands_where_it_is():
    noon = light_at(PLACED, utc("2026-06-21T11:15"))
    assert math.isclose(np.linalg.norm(noon.towards), 1, abs_tol=1e-9)
    assert elevation_deg(noon) == pytest.approx(90 - 48.14 + 23.44, abs=0.3)
    assert azimuth_deg(noon) == pytest.approx(180, abs=3)
    assert (noon.sun_rgb, noon.sky_rgb) == (daylight.WHITE, daylight.WHITE)
    morning, evening = light_at(PLACED, utc("2026-06-21T05:00")), light_at(PLACED, utc("2026-06-21T18:00"))
    assert 60 < azimuth_deg(morning) < 100
    assert 260 < azimuth_deg(evening) < 310
    assert evening.sun_rgb[0] > evening.sun_rgb[2], "a low sun is warm"
    midnight = light_at(PLACED, utc("2026-12-21T23:00"))
    assert (midnight.sun_rgb, midnight.sky_rgb) == (daylight.SUN[0][1], daylight.SKY[0][1])


def test_night_is_darker_and_bluer_than_day():
    rgb, up = np.full((1, 1, 3), 200, np.uint8), np.full((1, 1, 3), (128, 128, 255), np.uint8)
    by_day, by_night = (light_colors(rgb, up, light_at(PLACED, utc(time)))[0, 0].astype(int) for time in ("2026-06-21T11:15", "2026-06-21T23:00"))
    assert (by_night < by_day).all()
    assert by_night[2] > by_night[0]
    assert np.ptp(by_day) == 0
    assert np.array_equal(light_colors(rgb, up), light_colors(rgb, up, DEFAULT_LIGHT))


def test_the_time_is_part_of_the_address():
    request = parse_picture(PLACED, WHERE, SIZE, None, "2026-06-21T16:30Z")
    assert request.time == utc("2026-06-21T16:30")
    assert request.address.endswith("?style=lit&t=2026-06-21T16:30Z")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "now",
        "2026-06-21",
        "2026-06-21T16:30",
        "2026-06-21T16:30:00Z",
        "2026-13-21T16:30Z",
        "2026-02-30T16:30Z",
        "1899-12-31T23:59Z",
        "2101-01-01T00:00Z",
        "0000-01-01T00:00Z",
        "٢٠٢٦-06-21T16:30Z",
        "2026-06-21T16:30Z\n",
        "2026-06-21T24:00Z",
    ],
)
def test_other_times_are_refused(text):
    with pytest.raises(BadRequest, match="is not a time"):
        parse_time(text)


def test_a_time_needs_a_place_and_the_lit_style():
    with pytest.raises(BadRequest, match="no known place"):
        parse_picture(MANIFEST, WHERE, SIZE, None, "2026-06-21T16:30Z")
    with pytest.raises(BadRequest, match="has no light"):
        parse_picture(PLACED, WHERE, SIZE, "color", "2026-06-21T16:30Z")
    plain = replace(PLACED, passes=((Layer("color", "color", "webp"),),))
    assert parse_picture(plain, WHERE, SIZE, None, "2026-06-21T16:30Z").address.endswith("?style=color"), "nothing to light"


@pytest.mark.parametrize(
    ("more", "time"),
    [
        ("", None),
        ("/t=2026-06-21T16:30Z", "2026-06-21T16:30"),
        ("/epoch=1/t=2026-06-21T16:30Z/id=4", "2026-06-21T16:30"),
        ("/t=never", None),
        ("/id=t=2026-06-21T16:30Z", None),
    ],
)
def test_a_link_is_shown_in_its_light(more, time):
    request = parse_link(PLACED, VIEW + more, (1200, 630), "image/jpeg")
    assert request.time == (None if time is None else utc(time))
    assert parse_link(MANIFEST, VIEW + more, (1200, 630), "image/jpeg").time is None, "the map cannot light a scene of unknown place either"
