"""Windows of previews: filled by content, or containing all of it."""

from dataclasses import replace

import numpy as np
import pytest

from map3d.geometry.frames import pin
from map3d.tiles.block_versions import BlockVersions
from map3d.tiles.manifest import Manifest, ManifestCrs, ManifestView
from map3d.tiles.occupancy import Occupancy
from map3d.tiles.preview import ASPECT, MIN_WIDTH_PX, choose_preview
from map3d.types import Layer, TileId, ViewAngles

BOX = ((0.0, 0.0, 0.0), (1000.0, 1000.0, 20.0))
FRAME = pin(BOX, 256, 0.1, [ViewAngles(0, 45)])[0]
SIDE = 2**FRAME.zmax


def manifest_of(grid):
    rows, columns = np.nonzero(grid)
    occupancy = Occupancy.from_tiles(FRAME.zmax, zip(columns, rows, strict=True))
    view = ManifestView(FRAME, occupancy, (BlockVersions(7),))
    layers = (Layer("normal", "normal", "png"), Layer("color", "color", "webp"))
    return Manifest("x", 7, True, ManifestCrs("local metres"), (0.0, 0.0, 0.0), BOX, (layers,), (view,))


def grid_of(shape):
    y, x = (np.mgrid[0:SIDE, 0:SIDE] + 0.5) / SIDE
    return {
        "rectangle": (abs(x - 0.5) < 0.4) & (abs(y - 0.5) < 0.3),
        "rhombus": abs(x - 0.5) / 0.45 + abs(y - 0.5) / 0.35 < 1,
        "tall": (abs(x - 0.5) < 0.1) & (abs(y - 0.5) < 0.45),
    }[shape]


@pytest.mark.parametrize("shape", ["rectangle", "rhombus", "tall"])
def test_connected_content_fills_the_window(shape):
    grid = grid_of(shape)
    preview = choose_preview(manifest_of(grid))
    left, top, width, height = preview.window
    assert width / height == pytest.approx(ASPECT)
    assert MIN_WIDTH_PX <= width < 2 * MIN_WIDTH_PX
    scale = SIDE / 2 ** preview.tiles[0].z / 256
    rows, columns = (slice(int(first * scale), int((first + size) * scale)) for first, size in ((top, height), (left, width)))
    assert grid[rows, columns].mean() > 0.97


def test_separate_objects_lie_inside_the_window():
    grid = np.zeros((SIDE, SIDE), bool)
    grid[SIDE // 4, SIDE // 4] = grid[SIDE // 2, 3 * SIDE // 4] = True
    preview = choose_preview(manifest_of(grid))
    left, top, width, height = preview.window
    side_px = 256 * 2 ** preview.tiles[0].z
    assert left <= 0.25 * side_px
    assert left + width >= 0.75 * side_px
    assert top <= 0.25 * side_px
    assert top + height >= 0.5 * side_px


def test_a_preview_has_the_tiles_that_its_window_shows():
    preview = choose_preview(manifest_of(grid_of("rectangle")))
    left, top, width, height = preview.window
    assert (preview.view, preview.layer.name) == ("0-45", "color")
    assert all(left - 256 < tile.x * 256 < left + width and top - 256 < tile.y * 256 < top + height for tile in preview.tiles)
    assert len(preview.tiles) <= 24


def test_a_small_rendering_shows_its_deepest_level():
    frame = replace(FRAME, zmax=0)
    manifest = replace(manifest_of(grid_of("tall")), views=(ManifestView(frame, Occupancy.from_tiles(0, [(0, 0)]), (BlockVersions(),)),))
    assert list(choose_preview(manifest).tiles) == [TileId(0, 0, 0)]


def test_no_tiles_or_no_colour_layer_have_no_preview():
    manifest = manifest_of(np.zeros((SIDE, SIDE), bool))
    assert choose_preview(manifest) is None
    full = manifest_of(grid_of("tall"))
    assert choose_preview(replace(full, passes=((Layer("normal", "normal", "png"),),))) is None


def test_content_that_is_small_in_its_square_fills_the_window():
    frame = pin(BOX, 256, 0.005, [ViewAngles(0, 45)])[0]
    first = 2 ** (frame.zmax - 1)
    full = manifest_of(grid_of("rectangle"))
    occupancy = Occupancy.from_tiles(frame.zmax, [(first + x, first + y) for y in range(12) for x in range(30)])
    preview = choose_preview(replace(full, views=(replace(full.views[0], frame=frame, occupancy=occupancy),)))
    assert preview.window[2] / 2 ** preview.tiles[0].z / 256 < 1.5 * 32 / 2**frame.zmax


def test_a_single_building_is_shown_whole():
    box = ((0.0, 0.0, 0.0), (60.0, 50.0, 20.0))
    frame = pin(box, 256, 0.02, [ViewAngles(0, 45)])[0]
    y, x = (np.mgrid[0 : 2**frame.zmax, 0 : 2**frame.zmax] + 0.5) / 2**frame.zmax
    grid = (abs(x - 0.5) < 0.1) & (abs(y - 0.5) < 0.08)
    full = manifest_of(grid_of("rectangle"))
    rows, columns = np.nonzero(grid)
    view = replace(full.views[0], frame=frame, occupancy=Occupancy.from_tiles(frame.zmax, zip(columns, rows, strict=True)))
    preview = choose_preview(replace(full, views=(view,)))
    left, top, width, height = preview.window
    side_px = 256 * 2 ** preview.tiles[0].z
    assert left <= 0.4 * side_px
    assert left + width >= 0.6 * side_px
    assert top <= 0.43 * side_px
    assert top + height >= 0.57 * side_px
