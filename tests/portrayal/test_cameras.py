"""Every way to ask for one view leads to one camera; systems of coordinates and their axes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Transformer

from map3d.catalogue import SceneRecord
from map3d.geometry.crs import parse_crs
from map3d.geometry.views import axes
from map3d.ingest.scene_crs import to_scene_crs
from map3d.portrayal.cameras import ViewCamera, clip_to_content, to_camera
from map3d.portrayal.projections import parse_projection
from map3d.portrayal.request_crs import RequestCrs, canonical_name, systems_of
from map3d.portrayal.service_exception import ServiceException
from map3d.types import ViewAngles

UTM_ORIGIN = (691000.0, 5336000.0, 500.0)
GK_ORIGIN = (3500000.0, 5400000.0, 0.0)


def scene(crs: str, origin: tuple[float, float, float]) -> SceneRecord:
    return SceneRecord("town", crs=to_scene_crs(parse_crs(crs)), origin=origin)


UTM = systems_of(scene("EPSG:25832+7837", UTM_ORIGIN))
GK = systems_of(scene("EPSG:31467", GK_ORIGIN))
EXTENT = ((-100.0, -100.0, -10.0), (100.0, 100.0, 50.0))


def camera(text: str, crs: RequestCrs | None = None, size: tuple[int, int] = (200, 100)) -> ViewCamera:
    request = parse_projection(text.split(","), "portrayals")
    return clip_to_content(to_camera(request, crs or UTM.find("EPSG:25832"), *size, "portrayals"), EXTENT)


def tuple_of(name: str, poc: object, poi: object, rest: str) -> str:
    return ",".join([name, *(f"{float(value)!r}" for value in [*np.ravel(poc), *np.ravel(poi)]), rest])


POC, POI = np.array([691050.0, 5335700.0, 900.0]), np.array([691050.0, 5336050.0, 510.0])


@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(0, 800))
def test_a_shifted_poc_of_an_orthographic_view_changes_nothing(right: float, up: float, back: float) -> None:
    r, u, d = (np.array(axis) for axis in camera(tuple_of("Orthographic", POC, POI, "0,0,1,-100,100,-50,50,,")).axes)
    shift = r * right + u * up - d * back
    borders = f"{-100 - right!r},{100 - right!r},{-50 - up!r},{50 - up!r}"
    first, second = (
        camera(tuple_of("Orthographic", POC, POI, "0,0,1,-100,100,-50,50,,")),
        camera(tuple_of("Orthographic", POC + shift, POI + shift, f"0,0,1,{borders},,")),
    )
    assert np.allclose(first.axes, second.axes, atol=2e-9)
    assert np.allclose(first.window, second.window, atol=2e-6)
    assert (first.near_m, first.far_m) == (second.near_m, second.far_m)
    assert math.isclose(first.depth_zero_m - second.depth_zero_m, back, abs_tol=1e-5)


def test_plain_shifts_are_the_same_camera() -> None:
    first = camera(tuple_of("Orthographic", POC, POI, "0,0,1,-100,100,-50,50,,"))
    for east in (1.0, -250.0, 37.5):
        shift = np.array([east, 0, 0])
        moved = camera(tuple_of("Orthographic", POC + shift, POI + shift, f"0,0,1,{-100 - east},{100 - east},-50,50,,"))
        assert moved == first


@pytest.mark.parametrize("name", ["Orthographic", "Perspective"])
def test_aliases_of_a_camera(name: str) -> None:
    rest = "-100,100,-50,50,," if name == "Orthographic" else "60,,,"
    first = camera(tuple_of(name, POC, POI, f"0,0,1,{rest}"))
    assert camera(tuple_of(name, POC, POI, f",,,{rest}")) == first
    assert camera(tuple_of(name, POC, POI, f"0.0,0,2,{rest}")) == first
    assert camera(tuple_of(name, POC, POI, f"691050,5335700,1000,{rest}")) == first, "UP as a position"
    assert camera(tuple_of(name, POC, POC + (POI - POC) * 3, f"0,0,1,{rest}")) == first, "a point farther along the line of sight"
    assert camera(tuple_of(name.lower(), POC, POI, f"0,0,1,{rest}")) == first


def test_only_one_field_of_view_derives_the_other() -> None:
    x, y = math.tan(math.radians(30)), math.tan(math.radians(30)) / 2
    for rest in ("60,,,", ",,,", f"60,{math.degrees(2 * math.atan(y))!r},,", f",{math.degrees(2 * math.atan(y))!r},,"):
        assert np.allclose(camera(tuple_of("Perspective", POC, POI, f"0,0,1,{rest}")).window, (-x, x, -y, y), atol=1e-9)


def test_axes_of_a_stored_pyramid_replace_nearly_equal_ones() -> None:
    stored = axes(ViewAngles(30, 22.5))
    direction = np.array(stored.forward)
    request = parse_projection(
        tuple_of("Orthographic", np.round(POI - direction * 2000, 4), np.round(POI, 4), "0,0,1,,,,,,").split(","), "portrayals"
    )
    assert to_camera(request, UTM.find("EPSG:25832"), 10, 10, "portrayals", [axes(ViewAngles(0, 45)), stored]).axes == stored


@pytest.mark.parametrize(
    ("poi", "up", "text"),
    [(POC, "0,0,1", "same point"), (POC - [0, 0, 50], "0,0,1", "UP has the direction"), (POI, "0,0,0", "UP has the direction")],
)
def test_directions_that_describe_no_view(poi: np.ndarray, up: str, text: str) -> None:
    with pytest.raises(ServiceException, match=text):
        camera(tuple_of("Perspective", POC, poi, f"{up},,,,"))


def test_straight_down_has_north_above() -> None:
    for up in (",,", "0,1,0"):
        found = camera(tuple_of("Perspective", POC, POC - [0, 0, 50], f"{up},,,,")).axes
        assert np.allclose(found, [(1, 0, 0), (0, 1, 0), (0, 0, -1)])


# -- coordinate systems ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    ["EPSG:25832", "epsg:25832", "urn:ogc:def:crs:EPSG::25832", "urn:ogc:def:crs:EPSG:9.8:25832", "http://www.opengis.net/def/crs/EPSG/0/25832",
     "https://www.opengis.net/def/crs/EPSG/0/25832", "http://www.opengis.net/gml/srs/epsg.xml#25832"],
)  # fmt: skip
def test_spellings_of_a_system(name: str) -> None:
    assert UTM.find(name) is UTM.find("EPSG:25832")
    assert UTM.find("EPSG:25832").to_local((691001.0, 5336002.0, 503.0), "crs") == (1.0, 2.0, 3.0)


def test_compound_systems_and_the_vertical_datum_are_advertised() -> None:
    assert UTM.advertised == ("EPSG:25832", "EPSG:25832+7837", "EPSG:4326", "CRS:84", "EPSG:7837")
    assert UTM.find("urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837").to_local(UTM_ORIGIN, "crs") == (0, 0, 0)


@pytest.mark.parametrize("name", ["EPSG:7837", "EPSG:2056", "", "WKT", "+proj=utm", "EPSG:٢٥٨٣٢", "x" * 190])
def test_systems_that_are_not_advertised_are_refused(name: str) -> None:
    with pytest.raises(ServiceException, match="not available"):
        UTM.find(name)
    with pytest.raises(ServiceException) as raised:
        UTM.find(name, info=True)
    assert raised.value.code == "CRSNotSupported"


def test_northings_come_first_where_the_system_says_so() -> None:
    own = GK.find("EPSG:31467")
    assert own.to_local((5400020.0, 3500010.0, 5.0), "crs") == (10.0, 20.0, 5.0)
    assert own.from_local((10.0, 20.0, 5.0)) == (5400020.0, 3500010.0, 5.0)
    assert own.direction_to_local((1.0, 0.0, 0.0)) == (0.0, 1.0, 0.0)


@pytest.mark.parametrize(("name", "swap"), [("EPSG:4326", True), ("CRS:84", False), ("urn:ogc:def:crs:OGC:1.3:CRS84", False)])
def test_geographic_systems_by_pyproj(name: str, swap: bool) -> None:
    lon, lat = Transformer.from_crs("EPSG:25832", "EPSG:4326", always_xy=True).transform(691123.0, 5336045.0)
    local = UTM.find(name).to_local((lat, lon, 510.0) if swap else (lon, lat, 510.0), "crs")
    assert np.allclose(local, (123, 45, 10), atol=1e-6)
    assert np.allclose(UTM.find(name).from_local((123.0, 45.0, 10.0)), (lat, lon, 510) if swap else (lon, lat, 510))


def test_swapped_degrees_are_out_of_range() -> None:
    with pytest.raises(ServiceException, match="order of its axes"):
        UTM.find("CRS:84").to_local((11.5, 148.1, 500.0), "portrayals")


def test_one_view_in_three_systems() -> None:
    expected = camera(tuple_of("Perspective", POC, POI, "0,0,1,60,,,"))
    for name in ("EPSG:4326", "CRS:84"):
        crs = UTM.find(name)
        poc, poi = (crs.from_local(tuple(float(v) for v in point - np.array(UTM_ORIGIN))) for point in (POC, POI))
        found = camera(tuple_of("Perspective", poc, poi, "0,0,1,60,,,"), crs)
        assert np.allclose(found.position, expected.position, atol=1e-5)
        assert np.allclose(found.axes, expected.axes, atol=1e-8)


def test_local_systems_have_a_name_of_their_own() -> None:
    local = systems_of(SceneRecord("desk", origin=(1.0, 2.0, 3.0)))
    assert local.advertised == ("urn:map3d:def:crs:local:desk",)
    assert local.find("urn:map3d:def:crs:local:desk").to_local((2.0, 4.0, 6.0), "crs") == (1.0, 2.0, 3.0)


def test_names_that_are_too_long_are_refused() -> None:
    with pytest.raises(ServiceException, match="limit is 200"):
        canonical_name("x" * 201)
