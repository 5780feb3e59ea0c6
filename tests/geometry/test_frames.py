import json
import math
from pathlib import Path

import numpy as np
import pytest

from map3d.errors import BadRequest, LimitExceeded, OutsideFrame
from map3d.geometry.frames import NO_DEPTH, Window, check_content, corners, pin, pin_into
from map3d.geometry.views import uvd_from_local
from map3d.types import Layer, Sun, TileId, ViewAngles

VECTORS = Path(__file__).parents[2] / "spec" / "vectors"
FRAMES = json.loads((VECTORS / "frames.json").read_text())
WINDOWS = json.loads((VECTORS / "windows.json").read_text())
TILES = json.loads((VECTORS / "tiles.json").read_text())
BOX = ((-120.0, -80.0, 0.0), (130.0, 90.0, 22.5))


def pinned(row):
    lo, hi = (tuple(corner) for corner in row["box"])
    window = Window(*row["window"]) if "window" in row else None
    return pin((lo, hi), row["tile_px"], row["res_m"], [ViewAngles(*view) for view in row["views_deg"]], window)


@pytest.mark.parametrize("row", FRAMES + WINDOWS)
def test_frames_follow_the_vectors(row):
    for got, expected in zip(pinned(row), row["pinned"]["views"], strict=True):
        assert (got.zmax, got.size_m) == (row["pinned"]["zmax"], row["pinned"]["size_m"])
        assert got.id == expected["id"]
        assert (got.u0_m, got.v0_m, got.d0_m) == (expected["u0_m"], expected["v0_m"], expected["d0_m"])


@pytest.mark.parametrize("row", TILES["rows"])
def test_pixel_centres_follow_the_vectors(row):
    frame = pinned(FRAMES[0])[TILES["view"]]
    u, v = frame.uv_from_pixel(TileId(*row["tile"]), *row["pixel"])
    assert (float(u), float(v)) == (row["u"], row["v"])


@pytest.mark.parametrize("row", TILES["rows"])
def test_a_pixels_centre_is_in_that_pixel(row):
    frame = pinned(FRAMES[0])[TILES["view"]]
    tile = TileId(*row["tile"])
    u, v = frame.uv_from_pixel(tile, *row["pixel"])
    assert frame.pixel_from_uv(tile.z, float(u), float(v)) == (tile, *row["pixel"])


def test_a_pixel_and_its_depth_give_back_the_local_position():
    frame = pin(BOX, 256, 0.2, [ViewAngles(37.5, 30)])[0]
    local = np.random.default_rng(2).uniform(BOX[0], BOX[1], (100, 3))
    px, py, depth = frame.level_pixel_from_local(frame.zmax, local)
    back = frame.local_from_pixel(TileId(frame.zmax, 0, 0), px - 0.5, py - 0.5, depth)
    np.testing.assert_allclose(back, local, atol=1e-8)


def test_nothing_has_no_position():
    frame = pin(BOX, 256, 0.2, [ViewAngles(0, 45)])[0]
    assert np.isnan(frame.local_from_pixel(TileId(0, 0, 0), [3], [4], [NO_DEPTH])).all()


@pytest.mark.parametrize("box", [((0.0,) * 3, (0.0,) * 3), ((-1e5, -2e5, -100.0), (1e5, 2e5, 5000.0)), ((5.0, 5.0, 700.0), (6.0, 5.0, 700.0))])
def test_every_view_holds_the_box_with_a_kilometre_in_front(box):
    for frame in pin(box, 256, 1.0, [ViewAngles(a, p) for a in (0, 33, 45, 200) for p in (5, 45, 90)]):
        frame.check_holds(box)
        nearest = uvd_from_local(frame.axes, corners(box))[:, 2].min()
        assert nearest - frame.d0_m >= 1000


def test_the_square_is_the_smallest_of_its_kind():
    frame = pin(BOX, 256, 0.2, [ViewAngles(0, 45)])[0]
    assert frame.size_m == 256 * 0.2 * 2**frame.zmax
    flat = math.hypot(125 * 1.05, 85 * 1.05)
    assert frame.size_m / 2 < max(2 * flat, 2 * (math.sin(math.pi / 4) * flat + math.cos(math.pi / 4) * 111.25)) <= frame.size_m


def test_content_outside_names_regrid():
    frame = pin(BOX, 256, 0.2, [ViewAngles(0, 45)])[0]
    with pytest.raises(OutsideFrame, match=r"content leaves the pinned square.*--regrid"):
        frame.check_holds(((-120.0, -80.0, 0.0), (130.0, 9000.0, 22.5)))
    plan = pin(BOX, 256, 0.2, [ViewAngles(0, 90)])[0]
    with pytest.raises(OutsideFrame, match=r"content has depths that cannot be stored.*--regrid"):
        plan.check_holds(((-120.0, -80.0, 0.0), (130.0, 90.0, 9000.0)))
    with pytest.raises(OutsideFrame, match="pinned square"):
        frame.pixel_from_uv(0, frame.u0_m - 1, frame.v0_m - 1)


def test_content_nearer_than_depth_zero_is_outside():
    frame = pin(BOX, 256, 100.0, [ViewAngles(0, 90)])[0]
    with pytest.raises(OutsideFrame):
        frame.check_holds(((0.0, 0.0, 0.0), (1.0, 1.0, 3000.0)))


def test_a_view_that_joins_takes_over_the_size():
    first = pin(BOX, 256, 0.2, [ViewAngles(0, 45)])[0]
    both = pin(BOX, 256, 0.2, [ViewAngles(0, 45), ViewAngles(90, 45)])
    assert pin_into(first, BOX, ViewAngles(90, 45)) == both[1]


@pytest.mark.parametrize(
    ("tile_px", "res_m", "views"),
    [
        (256, 0.0, [(0, 45)]),
        (256, math.nan, [(0, 45)]),
        (0, 1.0, [(0, 45)]),
        (300, 1.0, [(0, 45)]),
        (128, 1.0, [(0, 45)]),
        (1024, 1.0, [(0, 45)]),
        (256, 1.0, []),
        (256, 1.0, [(0, 45), (0.0, 45.0)]),
    ],
)
def test_requests_without_meaning_are_refused(tile_px, res_m, views):
    with pytest.raises(BadRequest):
        pin(BOX, tile_px, res_m, [ViewAngles(*view) for view in views])


@pytest.mark.parametrize("box", [((0, 0, 0), (-1, 1, 1)), ((0, 0, math.nan), (1, 1, 1)), ((math.inf,) * 3, (-math.inf,) * 3)])
def test_an_invalid_box_is_refused(box):
    with pytest.raises(BadRequest):
        pin(box, 256, 1.0, [ViewAngles(0, 45)])


def test_levels_beyond_the_deepest_are_refused():
    with pytest.raises(LimitExceeded, match="26"):
        pin(((0, 0, 0), (1e8, 1e8, 1)), 256, 1e-3, [ViewAngles(0, 45)])


def test_the_cores_frame_names_its_layers():
    frame = pin(BOX, 256, 0.2, [ViewAngles(0, 45)])[0]
    got = frame.to_json([Layer("color", "color", "webp", 80), Layer("id", "id", "png")])
    assert got["layers"] == [{"kind": "color", "format": "webp", "quality": 80}, {"kind": "id", "format": "png"}]
    assert (got["look_at_deg"], got["zmax"], got["size_m"]) == (0, frame.zmax, frame.size_m)


def test_layers_of_light_reach_the_core_as_directions_and_radius():
    noon, evening = Sun("2026-06-21T12:00:00Z", 180.0, 60.0, (0.0, -0.5, 0.75**0.5)), Sun(None, 270.0, 0.0, (-1.0, 0.0, 0.0))
    layers = [
        Layer("noon", "sun", "png", suns=(noon,)),
        Layer("day", "sun16", "png", suns=(noon, evening)),
        Layer("ao", "ao", "png", radius_m=20.0),
        Layer("behind", "depth2", "png"),
        Layer("picture", "picture", "webp", 70, (evening,), 5.0),
    ]
    assert pin(BOX, 256, 0.2, [ViewAngles(0, 45)])[0].to_json(layers)["layers"] == [
        {"kind": "sun", "format": "png", "suns": [[0.0, -0.5, 0.75**0.5]]},
        {"kind": "sun16", "format": "png", "suns": [[0.0, -0.5, 0.75**0.5], [-1.0, 0.0, 0.0]]},
        {"kind": "ao", "format": "png", "radius_m": 20.0},
        {"kind": "depth2", "format": "png"},
        {"kind": "picture", "format": "webp", "quality": 70, "suns": [[-1.0, 0.0, 0.0]], "radius_m": 5.0},
    ]


SCENE = ((-800.0, -800.0, 0.0), (800.0, 800.0, 60.0))


def test_a_window_is_the_requested_square():
    frame = pin(SCENE, 256, 0.25, [ViewAngles(0, 45)], Window(100.0, -50.0, 512.0))[0]
    assert (frame.size_m, frame.zmax) == (512.0, 3)
    middle = uvd_from_local(frame.axes, (100.0, -50.0, 30.0))
    np.testing.assert_allclose([frame.u0_m + 256, frame.v0_m - 256], middle[:2])


def test_a_window_is_enlarged_to_a_whole_number_of_tiles():
    assert pin(SCENE, 256, 0.25, [ViewAngles(0, 45)], Window(0.0, 0.0, 512.1))[0].size_m == 1024.0


def test_depths_count_from_where_they_do_without_a_window():
    views = [ViewAngles(0, 45), ViewAngles(120, 20)]
    for small, whole in zip(pin(SCENE, 256, 0.25, views, Window(300.0, 300.0, 64.0)), pin(SCENE, 256, 0.25, views), strict=True):
        assert small.d0_m == whole.d0_m


def test_a_square_town_fills_a_window_of_its_width_times_the_sine_of_the_pitch():
    """Seen at 45 degrees, ground of 1600 m is 1131 m high: a square of that side is full where no horizon ends it."""
    frame = pin(SCENE, 256, 1131 / 2048, [ViewAngles(0, 45)], Window(0.0, 0.0, 1131.0))[0]
    ground = frame.clipped(((-800.0, -800.0, 30.0), (800.0, 800.0, 30.0)))
    assert np.ptp(ground[:, 0]) == pytest.approx(frame.size_m)
    assert np.ptp(ground[:, 1]) > 0.99 * frame.size_m


def test_content_beside_a_window_is_left_out_and_without_one_refused():
    window = Window(0.0, 0.0, 128.0)
    grown = ((-5000.0, -800.0, 0.0), (800.0, 800.0, 60.0))
    check_content(pin(SCENE, 256, 0.25, [ViewAngles(0, 45)], window)[0], grown, window)
    with pytest.raises(OutsideFrame, match="--regrid"):
        check_content(pin(SCENE, 256, 0.25, [ViewAngles(0, 45)])[0], grown, None)


def test_content_nearer_than_depth_zero_is_refused_inside_a_window_only():
    window = Window(0.0, 0.0, 128.0)
    frame = pin(SCENE, 256, 0.25, [ViewAngles(0, 90)], window)[0]
    frame.check_window(SCENE)
    with pytest.raises(OutsideFrame, match="--regrid"):
        frame.check_window(((-10.0, -10.0, 0.0), (10.0, 10.0, 5000.0)))
    slanted = pin(SCENE, 256, 0.25, [ViewAngles(0, 45)], window)[0]
    far_behind = ((-800.0, -9000.0, 0.0), (800.0, 800.0, 60.0))
    with pytest.raises(OutsideFrame):
        slanted.check_holds(far_behind)
    slanted.check_window(far_behind)


def test_the_visible_part_of_a_box_is_inside_the_square_and_the_box():
    frame = pin(SCENE, 256, 0.25, [ViewAngles(33, 40)], Window(200.0, 100.0, 256.0))[0]
    seen = frame.clipped(SCENE)
    assert len(seen) >= 4
    corner, side = np.array([frame.u0_m, frame.v0_m - frame.size_m]), frame.size_m
    assert seen[:, :2].min(axis=0) == pytest.approx(np.maximum(corner, seen[:, :2].min(axis=0)))
    assert seen[:, :2].max(axis=0) == pytest.approx(np.minimum(corner + side, seen[:, :2].max(axis=0)))
    dense = uvd_from_local(frame.axes, np.random.default_rng(3).uniform(SCENE[0], SCENE[1], (200_000, 3)))
    inside = ((dense[:, :2] >= corner) & (dense[:, :2] <= corner + side)).all(axis=1)
    assert seen[:, 2].min() <= dense[inside, 2].min()
    assert seen[:, 2].max() >= dense[inside, 2].max()


def test_a_window_beside_the_scene_is_refused():
    with pytest.raises(BadRequest, match="does not meet the scene"):
        pin(SCENE, 256, 0.25, [ViewAngles(0, 45)], Window(5000.0, 0.0, 128.0))


def test_a_view_that_joins_a_window_takes_over_its_middle_and_side():
    window = Window(100.0, 0.0, 300.0)
    first = pin(SCENE, 256, 0.25, [ViewAngles(0, 45)], window)[0]
    both = pin(SCENE, 256, 0.25, [ViewAngles(0, 45), ViewAngles(90, 30)], window)
    assert pin_into(first, SCENE, ViewAngles(90, 30), window) == both[1]


@pytest.mark.parametrize("numbers", [(0, 0, 0), (0, 0, -1), (0, 0, math.inf), (math.nan, 0, 1), (0, math.inf, 1)])
def test_windows_without_meaning_are_refused(numbers):
    with pytest.raises(BadRequest, match="window"):
        Window(*numbers)
