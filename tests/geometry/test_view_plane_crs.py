import shutil
import subprocess

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS, Transformer

from map3d.errors import BadRequest, CrsError
from map3d.geometry.frames import pin
from map3d.geometry.view_plane_crs import view_plane_crs
from map3d.geometry.views import uvd_from_local
from map3d.types import ViewAngles

BOX = ((-120.0, -80.0, 0.0), (130.0, 90.0, 22.5))
ORIGINS = {
    25832: (691000.0, 5336000.0, 500.0),
    2056: (2600000.0, 1200000.0, 430.0),
    31467: (3500000.0, 5400000.0, 250.0),
    28992: (92000.0, 437000.0, 0.0),
}
"""31467 has its northing first."""


def plane(code, angles, height_m):
    frame = pin(BOX, 256, 0.1, [angles])[0]
    return frame, view_plane_crs(frame, ORIGINS[code], CRS.from_epsg(code), ORIGINS[code][2] + height_m, "plane")


def world(code, local):
    return tuple(o + p for o, p in zip(ORIGINS[code], local, strict=True))


@pytest.mark.parametrize("code", ORIGINS)
@settings(max_examples=8, deadline=None)
@given(look_at=st.integers(0, 359), pitch=st.integers(5, 90), x=st.floats(-120, 130), y=st.floats(-80, 90), height_m=st.floats(-30, 30))
def test_a_ground_point_at_the_reference_height_has_the_coordinates_of_the_pyramid(code, look_at, pitch, x, y, height_m):
    frame, crs = plane(code, ViewAngles(look_at, pitch), height_m)
    u, v, _ = uvd_from_local(frame.axes, (x, y, height_m))
    east, north, _ = world(code, (x, y, 0))
    for read in (crs, CRS.from_wkt(crs.to_wkt()), CRS.from_json(crs.to_json())):
        got = Transformer.from_crs(CRS.from_epsg(code), read, always_xy=True).transform(east, north)
        assert got == pytest.approx((u, v), abs=1e-5)


def test_authority_axis_order_gives_the_same_point():
    frame, crs = plane(31467, ViewAngles(35, 40), 7.0)
    east, north, _ = world(31467, (12.5, -33.0, 0))
    u, v, _ = uvd_from_local(frame.axes, (12.5, -33.0, 7.0))
    assert Transformer.from_crs("EPSG:31467", crs).transform(north, east) == pytest.approx((u, v), abs=1e-5)


def test_a_point_falls_on_the_pixel_that_the_pyramid_shows_there():
    frame, crs = plane(25832, ViewAngles(35, 40), 7.0)
    east, north, _ = world(25832, (12.5, -33.0, 0))
    u, v = Transformer.from_crs("EPSG:25832", crs, always_xy=True).transform(east, north)
    px, py = frame.level_pixel_from_uv(frame.zmax, u, v)
    want = frame.level_pixel_from_local(frame.zmax, (12.5, -33.0, 7.0))
    assert (px, py) == pytest.approx(want[:2], abs=1e-3)


def test_a_higher_point_appears_above_by_the_cosine_of_the_pitch():
    frame, low = plane(25832, ViewAngles(0, 60), 0.0)
    _, high = plane(25832, ViewAngles(0, 60), 10.0)
    east, north, _ = world(25832, (0, 0, 0))
    (_, below), (_, above) = (Transformer.from_crs("EPSG:25832", crs, always_xy=True).transform(east, north) for crs in (low, high))
    assert above - below == pytest.approx(10.0 * 0.5)
    assert frame.axes.up[2] == 0.5


def test_units_of_the_base_are_converted_to_metres():
    frame = pin(BOX, 256, 0.1, [ViewAngles(20, 50)])[0]
    base = CRS.from_epsg(2263)
    foot = base.axis_info[0].unit_conversion_factor
    crs = view_plane_crs(frame, (300000.0, 60000.0, 0.0), base, 0.0, "feet")
    u, v, _ = uvd_from_local(frame.axes, (25.0, 40.0, 0.0))
    got = Transformer.from_crs(base, crs, always_xy=True).transform((300000.0 + 25.0) / foot, (60000.0 + 40.0) / foot)
    assert got == pytest.approx((u, v), abs=1e-4)


def test_a_compound_crs_counts_by_its_horizontal_part():
    frame = pin(BOX, 256, 0.1, [ViewAngles(0, 45)])[0]
    flat, compound = (view_plane_crs(frame, ORIGINS[25832], CRS.from_user_input(name), 500.0, "plane") for name in ("EPSG:25832", "EPSG:25832+7837"))
    assert flat == compound


def test_local_coordinates_give_an_engineering_crs():
    frame = pin(BOX, 256, 0.1, [ViewAngles(0, 45)])[0]
    crs = view_plane_crs(frame, (0.0, 0.0, 0.0), None, 0.0, "plane of a model")
    assert crs.is_engineering
    assert crs.name == "plane of a model"


@pytest.mark.parametrize("height_m", [float("nan"), float("inf"), 100_000.1, -100_000.1])
def test_a_height_out_of_range_is_refused(height_m):
    frame = pin(BOX, 256, 0.1, [ViewAngles(0, 45)])[0]
    with pytest.raises(BadRequest, match="reference height"):
        view_plane_crs(frame, (0.0, 0.0, 0.0), None, height_m, "plane")


@pytest.mark.parametrize("name", ["EPSG:4326", "EPSG:5513"])
def test_a_base_without_easting_and_northing_is_refused(name):
    """5513 counts to the south and to the west."""
    frame = pin(BOX, 256, 0.1, [ViewAngles(0, 45)])[0]
    with pytest.raises(CrsError, match="east"):
        view_plane_crs(frame, (0.0, 0.0, 0.0), CRS.from_user_input(name), 0.0, "plane")


@pytest.mark.skipif(shutil.which("gdaltransform") is None, reason="GDAL is not installed: apt install gdal-bin")
@pytest.mark.parametrize("code", ORIGINS)
def test_gdal_transforms_to_the_plane(code, tmp_path):
    frame, crs = plane(code, ViewAngles(35, 40), 7.0)
    (tmp_path / "plane.wkt").write_text(crs.to_wkt())
    east, north, _ = world(code, (12.5, -33.0, 0))
    command = ["gdaltransform", "-s_srs", f"EPSG:{code}", "-t_srs", str(tmp_path / "plane.wkt")]
    done = subprocess.run(command, input=f"{east} {north}\n", capture_output=True, text=True, check=True)
    u, v, _ = uvd_from_local(frame.axes, (12.5, -33.0, 7.0))
    assert np.array(done.stdout.split()[:2], float) == pytest.approx((u, v), abs=1e-5)
