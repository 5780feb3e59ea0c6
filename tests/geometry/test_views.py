import json
import math
from pathlib import Path

import numpy as np
import pytest

from map3d.errors import BadRequest
from map3d.geometry.views import axes, check_angles, dot, local_from_uvd, parse_view, parse_view_id, uvd_from_local, view_id
from map3d.types import ViewAngles

VECTORS = json.loads((Path(__file__).parents[2] / "spec" / "vectors" / "views.json").read_text())
GRID = [ViewAngles(a, p) for a in (0, 0.1, 30, 45, 90, 135.5, 180, 270, 359.9) for p in (0.5, 10, 22.5, 30, 45, 60, 90)]


@pytest.mark.parametrize("row", VECTORS, ids=lambda row: row["id"])
def test_views_follow_the_vectors(row):
    angles = ViewAngles(row["look_at_deg"], row["pitch_deg"])
    view = axes(angles)
    assert view_id(angles) == row["id"]
    assert [list(axis) for axis in view] == [row["right"], row["up"], row["forward"]]
    local = [p["local"] for p in row["points"]]
    np.testing.assert_array_equal(uvd_from_local(view, local), [p["uvd"] for p in row["points"]])


@pytest.mark.parametrize("angles", GRID)
def test_axes_are_orthonormal_and_right_handed(angles):
    view = axes(angles)
    gram = np.array(view) @ np.array(view).T
    np.testing.assert_allclose(gram, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(np.cross(view.right, view.forward), view.up, atol=1e-15)


@pytest.mark.parametrize("angles", GRID)
def test_local_from_uvd_undoes_uvd_from_local(angles):
    points = np.random.default_rng(1).uniform(-5000, 5000, (50, 3))
    view = axes(angles)
    np.testing.assert_allclose(local_from_uvd(view, uvd_from_local(view, points)), points, atol=1e-9)


def test_45_degrees_looks_north_west():
    forward = axes(ViewAngles(45, 22.5)).forward
    assert forward[0] < 0 < forward[1]
    assert forward[0] == pytest.approx(-forward[1])


def test_straight_down_has_exact_axes():
    assert axes(ViewAngles(0, 90)) == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))


def test_nearer_points_have_smaller_depth():
    view = axes(ViewAngles(0, 45))
    assert dot(view.forward, (0.0, 0.0, 10.0)) < dot(view.forward, (0.0, 0.0, 0.0)) < dot(view.forward, (0.0, 10.0, 0.0))


@pytest.mark.parametrize("angles", GRID)
def test_view_ids_read_back(angles):
    assert parse_view_id(view_id(angles)) == check_angles(angles)


def test_ids_have_no_exponent():
    assert view_id(ViewAngles(0, 0.00001)) == "0-0.00001"
    assert parse_view_id("0-0.00001").pitch_deg == 0.00001


@pytest.mark.parametrize(
    "text",
    ["", "45", "45-", "-45-10", "045-10", "45.0-10", "45-10.50", "360-10", "0-0", "0-90.5", "45-1e1", "45-10\n", "٤-10", "45--10", "+1-2", "0-.5"],
)
def test_other_spellings_of_a_view_are_refused(text):
    with pytest.raises(BadRequest):
        parse_view_id(text)


@pytest.mark.parametrize(
    ("text", "angles"),
    [
        ("45-22.5", (45, 22.5)),
        ("45/22.5", (45, 22.5)),
        ("0/90", (0, 90)),
        ("45.0/022.50", (45, 22.5)),
        (" 45 / 22.5 ", (45, 22.5)),
        ("1e2/4.5e1", (100, 45)),
        ("315", (315, 45)),
        ("0", (0, 45)),
    ],
)
def test_a_view_is_parsed_with_a_slash_or_a_hyphen_and_printed_with_a_hyphen(text, angles):
    assert parse_view(text) == ViewAngles(*angles)
    assert view_id(parse_view(text)) == view_id(ViewAngles(*angles))


@pytest.mark.parametrize("angles", GRID)
def test_every_view_id_is_a_view(angles):
    assert parse_view(view_id(angles)) == check_angles(angles)


@pytest.mark.parametrize(
    "text", ["", "/", "-", "45/", "/45", "north", "45/22.5/1", "45-22-1", "360/45", "-45/30", "-45-30", "0/0", "0/91", "nan/45", "0/inf"]
)
def test_text_that_is_not_a_view_is_refused(text):
    with pytest.raises(BadRequest, match=r"view|look-at|pitch"):
        parse_view(text)


@pytest.mark.parametrize("angles", [(-1, 45), (360, 45), (0, 0), (0, 90.1), (math.nan, 45), (0, math.nan), (math.inf, 45)])
def test_angles_out_of_range_are_refused(angles):
    with pytest.raises(BadRequest):
        check_angles(ViewAngles(*angles))


def test_positions_need_three_coordinates():
    with pytest.raises(BadRequest, match="3 coordinates"):
        uvd_from_local(axes(ViewAngles(0, 45)), [1.0, 2.0])
