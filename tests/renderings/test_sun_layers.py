"""Requests for sun and ambient occlusion layers, and the sun directions in the axes of various coordinate systems."""

import itertools
import math
from dataclasses import replace
from datetime import UTC, date, datetime

import numpy as np
import pytest
from pyproj import CRS, Geod, Proj, Transformer

from map3d.catalogue import SceneCrs, SceneRecord
from map3d.errors import BadRequest
from map3d.geometry.crs import parse_crs
from map3d.geometry.grid_north import GridNorth
from map3d.geometry.sun import GeographicPosition, SunAngles, sun_angles
from map3d.ingest.scene_crs import LOCAL, to_scene_crs
from map3d.renderings.layers import make_layers
from map3d.requests import LayerDetails
from map3d.types import DEFAULT_LAYERS, Box, Layer, Sun

BOX: Box = ((-100.0, -50.0, 0.0), (300.0, 250.0, 40.0))
TIME = datetime(2026, 6, 21, 13, tzinfo=UTC)
DAY = date(2026, 6, 21)
LOCAL_SCENE = SceneRecord("town", crs=LOCAL, origin=(0.0, 0.0, 0.0))


def scene_at(code: str, longitude_deg: float, latitude_deg: float) -> SceneRecord:
    """Returns a scene whose box is centred there."""
    crs = parse_crs(code)
    x, y = Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(longitude_deg, latitude_deg)
    return SceneRecord("town", crs=to_scene_crs(crs), origin=(x - 100.0, y - 100.0, 0.0))


def only(layers: tuple[Layer, ...]) -> Layer:
    (layer,) = layers
    return layer


def sun_of(scene: SceneRecord, light: LayerDetails) -> Sun:
    (sun,) = only(make_layers(("sun",), light, scene, BOX)).suns
    return sun


@pytest.mark.parametrize(
    ("code", "longitude_deg", "latitude_deg"),
    [
        ("EPSG:25832", 9.0, 48.0), ("EPSG:25832", 6.1, 53.0), ("EPSG:25832", 15.9, 48.2), ("EPSG:32756", 155.5, -34.0), ("EPSG:2193", 169.0, -46.0),
        ("EPSG:28992", 6.8, 52.2), ("EPSG:2154", -4.4, 48.4), ("EPSG:5514", 14.4, 50.1), ("EPSG:31467", 8.0, 48.0), ("EPSG:25832+7837", 11.4, 48.7),
    ],
)  # fmt: skip
@pytest.mark.parametrize("azimuth_deg", [0.0, 37.0, 180.0, 271.5])
def test_azimuths_in_a_conformal_grid_differ_by_the_meridian_convergence(
    code: str, longitude_deg: float, latitude_deg: float, azimuth_deg: float
) -> None:
    scene = scene_at(code, longitude_deg, latitude_deg)
    convergence_deg = Proj(CRS(code).to_2d() if "+" not in code else CRS("EPSG:25832")).get_factors(longitude_deg, latitude_deg).meridian_convergence
    direction = sun_of(scene, LayerDetails(sun=SunAngles(azimuth_deg, 30.0))).direction
    a, e = math.radians(azimuth_deg - convergence_deg), math.radians(30.0)
    assert direction == pytest.approx((math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)), abs=5e-5), (
        "datums differ by some arc seconds"
    )


@pytest.mark.parametrize(
    ("code", "longitude_deg", "latitude_deg"),
    [
        ("EPSG:25832", 15.9, 48.2), ("EPSG:32756", 155.5, -34.0), ("EPSG:3035", 25.0, 60.0), ("EPSG:27572", 2.0, 48.0), ("EPSG:2048", 18.4, -34.0),
        ("EPSG:6933", 10.0, 50.0), ("EPSG:3857", 10.0, -50.0),
    ],
)  # fmt: skip
def test_shadows_fall_along_the_geodesic_away_from_the_sun(code: str, longitude_deg: float, latitude_deg: float) -> None:
    """Computes the tip of a mast's shadow on the ellipsoid and projects it: also where angles are distorted or axes point south."""
    scene = scene_at(code, longitude_deg, latitude_deg)
    sun = sun_of(scene, LayerDetails(sun=SunAngles(123.0, 40.0)))
    to_grid = Transformer.from_crs("EPSG:4326", code, always_xy=True)
    end = Geod(ellps="WGS84").fwd(longitude_deg, latitude_deg, 123.0 + 180.0, 30.0)[:2]
    foot, tip = np.array(to_grid.transform(longitude_deg, latitude_deg)), np.array(to_grid.transform(*end))
    away = (tip - foot) / np.linalg.norm(tip - foot)
    assert -np.array(sun.direction[:2]) / math.cos(math.radians(40.0)) == pytest.approx(away, abs=1e-5)
    assert np.linalg.norm(sun.direction) == pytest.approx(1.0, abs=1e-12)


def test_noon_sun_is_in_the_north_of_cape_town_where_axes_point_south_and_west() -> None:
    """In Lo19, x grows to the west and y to the south."""
    sun = sun_of(scene_at("EPSG:2048", 18.4, -33.9), LayerDetails(time=datetime(2026, 6, 21, 10, 48, tzinfo=UTC)))
    assert sun.azimuth_deg == pytest.approx(0.0, abs=1.0) or sun.azimuth_deg == pytest.approx(360.0, abs=1.0)
    assert sun.direction[1] < -0.8


def test_sun_position_is_that_of_the_scene_centre() -> None:
    sun = sun_of(scene_at("EPSG:25832", 15.9, 48.2), LayerDetails(time=TIME.replace(microsecond=999_999)))
    expected = sun_angles(GeographicPosition(48.2, 15.9), TIME)
    assert (sun.time, sun.azimuth_deg, sun.elevation_deg) == ("2026-06-21T13:00:00Z", *map(pytest.approx, expected))
    assert math.degrees(math.asin(sun.direction[2])) == pytest.approx(sun.elevation_deg)


def test_local_scene_has_north_along_y() -> None:
    sun = sun_of(LOCAL_SCENE, LayerDetails(time=TIME, place=GeographicPosition(48.2, 15.9)))
    a, e = map(math.radians, sun_angles(GeographicPosition(48.2, 15.9), TIME))
    assert sun.direction == pytest.approx((math.sin(a) * math.cos(e), math.cos(a) * math.cos(e), math.sin(e)))
    assert sun_of(LOCAL_SCENE, LayerDetails(sun=SunAngles(90.0, 45.0))) == Sun(None, 90.0, 45.0, pytest.approx((0.5**0.5, 0.0, 0.5**0.5), abs=1e-12))


def test_day_has_sixteen_suns_with_their_times() -> None:
    suns = only(make_layers(("sun16",), LayerDetails(day=DAY), scene_at("EPSG:25832", 11.4, 48.7), BOX)).suns
    assert [sun.time for sun in suns] == [f"2026-06-21T{hour:02}:00:00Z" for hour in range(4, 20)]
    heights = [sun.elevation_deg for sun in suns]
    assert max(heights) == pytest.approx(90 - 48.7 + 23.43, abs=0.5)
    assert all(later.azimuth_deg > sun.azimuth_deg for sun, later in itertools.pairwise(suns))


def test_sun_below_the_horizon_is_part_of_a_day_but_refused_as_a_single_sun() -> None:
    scene = scene_at("EPSG:25833", 20.0, 68.0)
    suns = only(make_layers(("sun16",), LayerDetails(day=date(2026, 12, 21)), scene, BOX)).suns
    assert all(sun.elevation_deg < 0 for sun in suns)
    with pytest.raises(BadRequest, match="below the horizon"):
        sun_of(scene, LayerDetails(time=datetime(2026, 12, 21, 11, tzinfo=UTC)))


def test_layers_have_the_parameters_of_their_kinds_in_the_order_of_kinds() -> None:
    light = LayerDetails(color="jpeg", quality=70, time=TIME, day=DAY, radius_m=7.5, place=GeographicPosition(48.0, 11.0))
    names = ("picture", "depth2", "behind=depth", "ao", "hours=sun16", "noon=sun", "color")
    layers = make_layers(names, light, LOCAL_SCENE, BOX)
    assert [(layer.name, layer.kind, layer.format, layer.quality, len(layer.suns), layer.radius_m) for layer in layers] == [
        ("color", "color", "jpeg", 70, 0, None),
        ("behind", "depth", "png", None, 0, None),
        ("noon", "sun", "png", None, 1, None),
        ("hours", "sun16", "png", None, 16, None),
        ("ao", "ao", "png", None, 0, 7.5),
        ("depth2", "depth2", "png", None, 0, None),
        ("picture", "picture", "jpeg", 70, 1, 7.5),
    ]
    assert only(make_layers(("ao",), LayerDetails(), LOCAL_SCENE, BOX)).radius_m == 20.0
    assert [layer.kind for layer in make_layers(DEFAULT_LAYERS, LayerDetails(), LOCAL_SCENE, BOX)] == ["color", "data"]


@pytest.mark.parametrize(
    ("names", "light", "says"),
    [
        (("sun",), LayerDetails(), "--time"),
        (("picture",), LayerDetails(radius_m=5.0), "--time"),
        (("sun",), LayerDetails(time=TIME, sun=SunAngles(0, 1)), "either"),
        (("sun",), LayerDetails(time=TIME.replace(tzinfo=None), place=GeographicPosition(0, 0)), "zone"),
        (("sun",), LayerDetails(time=TIME), "--place"),
        (("sun16",), LayerDetails(place=GeographicPosition(0, 0)), "--date"),
        (("sun16",), LayerDetails(day=DAY), "--place"),
        (("sun",), LayerDetails(time=TIME, place=GeographicPosition(0, 200)), "a longitude"),
        (("sun",), LayerDetails(sun=SunAngles(360.0, 10.0)), "azimuth"),
        (("sun",), LayerDetails(sun=SunAngles(0.0, 0.0)), "elevation"),
        (("sun",), LayerDetails(sun=SunAngles(0.0, math.nan)), "elevation"),
        (("color",), LayerDetails(time=TIME), "--time and --sun"),
        (("sun16",), LayerDetails(sun=SunAngles(0.0, 10.0), day=DAY, place=GeographicPosition(0, 0)), "--time and --sun"),
        (("ao",), LayerDetails(day=DAY), "--date"),
        (("color", "sun"), LayerDetails(sun=SunAngles(0.0, 10.0), radius_m=5.0), "--ao-radius"),
        (("ao",), LayerDetails(radius_m=0.4), "0.5 to 200"),
        (("ao",), LayerDetails(radius_m=math.nan), "0.5 to 200"),
    ],
)
def test_missing_or_unused_options_are_refused(names: tuple[str, ...], light: LayerDetails, says: str) -> None:
    with pytest.raises(BadRequest, match=says):
        make_layers(names, light, LOCAL_SCENE, BOX)


def test_place_for_a_located_scene_is_refused() -> None:
    with pytest.raises(BadRequest, match="leave --place out"):
        sun_of(scene_at("EPSG:25832", 9.0, 48.0), LayerDetails(time=TIME, place=GeographicPosition(48.0, 9.0)))


def test_point_outside_the_coordinate_system_is_refused() -> None:
    with pytest.raises(BadRequest, match="no point"):
        GridNorth(CRS("EPSG:25832").to_wkt(), 1e9, 1e9)
    lost = replace(LOCAL_SCENE, crs=SceneCrs(25832, CRS("EPSG:25832").to_wkt(), "ETRS89 / UTM zone 32N"), origin=(1e9, 1e9, 0.0))
    with pytest.raises(BadRequest, match="no point"):
        sun_of(lost, LayerDetails(time=TIME))
