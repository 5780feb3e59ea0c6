"""Pictures of views: their addresses, and their pixels against those of the pyramid."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from map3d.catalogue import Workspace
from map3d.errors import BadRequest, LimitExceeded
from map3d.geometry.views import local_from_uvd
from map3d.tile_services.picture import draw_picture, level_of
from map3d.tile_services.picture_request import MAX_SIDE_PX, parse_link, parse_picture
from map3d.tile_services.tiled_view import NotOffered
from map3d.tiles.light_colors import light_colors
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.sqlite_store import SqliteTileStore
from map3d.types import Layer
from tests.web.workspaces import OCCUPIED, ZMAX, manifest_of, rendering_record

MANIFEST = manifest_of(rendering_record(), Occupancy.from_tiles(ZMAX, OCCUPIED), 1)
WHERE, SIZE = "691010.5,5336020.25,3,45,22.5,505", "600x400.png"


def address(where=WHERE, size=SIZE, style=None):
    return parse_picture(MANIFEST, where, size, style).address


def test_an_address_is_its_own_canonical_form():
    assert address() == "691010.5,5336020.25,3,45,22.5,505/600x400.png?style=lit"
    where, _, size = address().partition("?")[0].partition("/")
    assert address(where, size) == address()


@pytest.mark.parametrize(
    "where",
    ["691010.50,5336020.250,3.0,45,22.5,505.00", "691010.5,5336020.25,3.00001,45.0,22.50,505.001", "691010.5,5336020.25,0.8m,45,22.5,505"],
)
def test_all_spellings_of_a_view_are_one_picture(where):
    expected = address() if "m" not in where else address(WHERE.replace(",3,", f",{math.log2(MANIFEST.views[0].frame.size_m / (256 * 0.8)):.4f},"))
    assert address(where) == expected


def test_pitch_and_height_may_be_left_out():
    request = parse_picture(MANIFEST, "691010.5,5336020.25,3,45", SIZE)
    assert request.view.frame.id == "45-22.5"
    assert request.centre[2] == 500.0


@given(x=st.floats(-1e6, 1e6), y=st.floats(-1e6, 1e6), zoom=st.floats(-3, ZMAX + 3))
def test_canonical_addresses_read_back(x, y, zoom):
    first = address(f"{x:.6f},{y:.6f},{zoom:.6f},0,45")
    where, _, size = first.partition("?")[0].partition("/")
    assert address(where, size) == first


@pytest.mark.parametrize(
    "where",
    [
        "",
        "1,2,3",
        "1,2,3,0,45,5,6",
        "nan,2,3,0",
        "1e3,2,3,0",
        "inf,2,3,0",
        "+1,2,3,0",
        "01,2,3,0",
        "١,2,3,0",
        " 1,2,3,0",
        "1,2,3,0\n",
        "1000000001,2,3,0",
        "100000000.01,2,3,0",
        "1,2,7.1,0",
        "1,2,-3.1,0",
        "1,2,0m,0",
        "1,2,-1m,0",
        "1,2,m,0",
        "1,2,3," + "9" * 300,
    ],
)
def test_other_numbers_are_refused(where):
    with pytest.raises(BadRequest):
        address(where)


@pytest.mark.parametrize("size", ["", "600", "600x400", "0x400.png", "600x400.gif", "600x400@3x.png", "-1x5.png", "600x400.png.png", "६00x400.png"])
def test_other_sizes_are_refused(size):
    with pytest.raises(BadRequest):
        address(size=size)


@pytest.mark.parametrize("size", [f"{MAX_SIDE_PX}x4096.png", "2048x2048@2x.png", "4096x1.jpg"])
def test_pictures_at_the_limit_are_allowed(size):
    assert size.partition(".")[0] in address(size=size)


@pytest.mark.parametrize("size", [f"{MAX_SIDE_PX + 1}x1.png", "1x4097.png", "2049x1@2x.png", "99999x99999.png"])
def test_larger_pictures_are_refused_with_the_limit(size):
    with pytest.raises(LimitExceeded, match="4,096"):
        address(size=size)


@pytest.mark.parametrize("where", ["1,2,3,1", "1,2,3,0,46"])
def test_views_that_are_not_stored_are_named(where):
    with pytest.raises(NotOffered, match=r"0-45, 45-22\.5"):
        address(where)


def test_the_style_depends_on_the_layers():
    assert parse_picture(MANIFEST, WHERE, SIZE).style == "lit"
    assert parse_picture(MANIFEST, WHERE, SIZE, "color").style == "color"
    with pytest.raises(NotOffered, match="lit, color"):
        address(style="normal")
    plain = replace(MANIFEST, passes=((Layer("color", "color", "webp"),),))
    assert parse_picture(plain, WHERE, SIZE).style == "color"
    with pytest.raises(NotOffered, match="no colour layer"):
        parse_picture(replace(MANIFEST, passes=((Layer("id", "id", "png"),),)), WHERE, SIZE)


def test_links_of_the_map_name_a_picture():
    request = parse_link(MANIFEST, "45-22.5/691010.5/5336020.2/505.0/3.25/t=2026-06-21T12:00Z/id=4", (1200, 630), "image/jpeg")
    assert request.address == "691010.5,5336020.2,3.25,45,22.5,505/1200x630.jpg?style=lit"
    for broken in ("", "45-22.5", "45-22.5/1/2/3", "45/1/2/3/4/5", "9-9/1/2/3/4", "45-22.5/a/b/c/d", "45-22.5/1/2/3/4" + "/x" * 200):
        with pytest.raises((BadRequest, NotOffered)):
            parse_link(MANIFEST, broken, (10, 10), "image/png")


def reader(town, pixels):
    path = Workspace(town).store_path(pixels.manifest.name, pixels.view.frame.id)

    def get_tile(layer, tile):
        with SqliteTileStore(path, read_only=True) as store:
            return store.get_tile(store.shape.layer_number(layer.name), *tile)

    return get_tile


def draw(town, pixels, request):
    with Image.open(io.BytesIO(draw_picture(pixels.manifest, request, reader(town, pixels)))) as image:
        return np.asarray(image.convert("RGBA"))


def request_at(pixels, z, column, row, size, style, zoom=None):
    """Returns a request for a picture whose centre is the corner between pixels of a level."""
    frame = pixels.frame
    u, v = frame.u0_m + column * frame.pixel_m(z), frame.v0_m - row * frame.pixel_m(z)
    centre = local_from_uvd(frame.axes, (u, v, frame.d0_m + 1500)) + np.array(pixels.manifest.origin)
    request = parse_picture(pixels.manifest, f"0,0,{z if zoom is None else zoom},35,40", f"{size[0]}x{size[1]}.png", style)
    return replace(request, centre=tuple(map(float, centre)))


@pytest.mark.parametrize("style", ["picture", "color"])
@pytest.mark.parametrize("z", [3, 1, 0])
def test_at_a_whole_zoom_pixels_are_those_of_the_level(town, pixels, style, z):
    side = 256 << z
    column, row = round(side * 0.45), round(side * 0.5)
    width, height = min(700, side), min(600, side)
    got = draw(town, pixels, request_at(pixels, z, column, row, (width, height), style))
    level = np.pad(pixels.level(style, z), ((600, 600), (700, 700), (0, 0)))
    want = level[600 + row - height // 2 :, 700 + column - width // 2 :][:height, :width]
    assert (got[..., 3] > 0).any()
    assert np.array_equal(got[..., 3], want[..., 3])
    assert np.array_equal(got[got[..., 3] > 0], want[want[..., 3] > 0])


def test_retina_pictures_show_the_same_part_with_twice_the_pixels(town, pixels):
    request = request_at(pixels, 2, 512, 512, (300, 200), "picture")
    large = draw(town, pixels, replace(request, scale=2))
    assert large.shape == (400, 600, 4)
    assert np.array_equal(large, draw(town, pixels, replace(request, zoom=3.0, size=(600, 400))))
    assert level_of(pixels.manifest, replace(request, scale=2)) == 3


def test_between_levels_the_picture_is_shrunk_from_the_finer_one(town, pixels):
    request = request_at(pixels, 3, 1024, 1024, (300, 300), "picture", zoom=2.5)
    got = draw(town, pixels, request)[..., :3].astype(float)
    half = round(150 * 2**0.5)
    with Image.fromarray(pixels.level("picture", 3)[1024 - half : 1024 + half, 1024 - half : 1024 + half]) as part:
        want = np.asarray(part.resize((300, 300), Image.Resampling.BOX))[..., :3].astype(float)
    assert np.abs(got - want).mean() < 6


def test_outside_the_pyramid_is_transparent_or_the_colour_of_paper(town, pixels):
    request = replace(request_at(pixels, 3, 0, 0, (40, 30), "picture"), centre=(0.0, 0.0, 0.0))
    assert not draw(town, pixels, request).any()
    paper = draw(town, pixels, replace(request, media_type="image/jpeg"))[..., :3].astype(int)
    assert np.abs(paper - (242, 240, 235)).max() <= 2


def test_light_is_that_of_the_viewer():
    """Surfaces towards the light, level, away from it, and without a normal, by the formula of the viewer's shader in float64."""
    azimuth, elevation = math.radians(215), math.radians(48)
    towards = np.array([math.sin(azimuth) * math.cos(elevation), math.cos(azimuth) * math.cos(elevation), math.sin(elevation)])
    for normal in (towards, np.array([0, 0, 1.0]), -towards, None):
        code = np.zeros(3, np.uint8) if normal is None else np.rint((normal + 1) / 2 * 255).astype(np.uint8)
        got = light_colors(np.full((3, 3, 3), 120, np.uint8), np.broadcast_to(code, (3, 3, 3)))
        lambert = 0.5 if normal is None else max(0.0, float(normal @ towards))
        linear = ((120 / 255 + 0.055) / 1.055) ** 2.4 * (0.42 + 0.76 * lambert)
        want = 255 * (1.055 * min(linear, 1) ** (1 / 2.4) - 0.055)
        assert np.abs(got.astype(float) - want).max() <= 1.5


def test_lit_pictures_have_the_coverage_of_the_colours(town, pixels):
    lit, color = (draw(town, pixels, request_at(pixels, 2, 500, 500, (300, 300), style)) for style in ("lit", "color"))
    assert np.array_equal(lit[..., 3], color[..., 3])
    assert not np.array_equal(lit, color)
