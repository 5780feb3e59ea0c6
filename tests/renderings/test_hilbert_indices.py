"""Blocks of all views that show the same ground have neighbouring Hilbert indices."""

from itertools import pairwise

import numpy as np
import pytest

from map3d.catalogue import RenderingRecord
from map3d.geometry.frames import PinnedFrame, Window, pin
from map3d.geometry.hilbert import hilbert_indices
from map3d.geometry.views import uvd_from_local
from map3d.renderings.hilbert_indices import GROUND_LEVEL, HILBERT_INDICES, HilbertIndices
from map3d.types import Box, ViewAngles

BOX: Box = ((-300.0, 100.0, 40.0), (700.0, 900.0, 60.0))
VIEWS = (ViewAngles(0, 45), ViewAngles(90, 45), ViewAngles(200, 30), ViewAngles(0, 90), ViewAngles(77, 5))
DEEP = 16
"""A level whose tiles are a few centimetres wide."""
COARSE = 6
"""The ground has squares of 16 m at this level."""


def record(window: Window | None = None) -> RenderingRecord:
    frames = tuple(pin(BOX, 256, 0.02, VIEWS, window))
    options = {} if window is None else {"window": {"x_m": window.x_m, "y_m": window.y_m, "size_m": window.size_m}}
    return RenderingRecord("town-a", "town", 0.02, ((),), frames, BOX, options=options)


def tile_at(frame: PinnedFrame, ground: tuple[float, float]) -> np.ndarray:
    """Returns column and row of the tile of level DEEP that shows a point on the ground at half height."""
    px, py, _ = frame.level_pixel_from_local(DEEP, (*ground, 50.0))
    return np.array([[int(px // frame.tile_px), int(py // frame.tile_px)]])


@pytest.mark.parametrize("ground", [(-299.0, 101.0), (0.0, 500.0), (207.0, 357.0), (699.0, 899.0)])
def test_tiles_of_all_views_at_a_point_have_the_number_of_its_square(ground: tuple[float, float]) -> None:
    numbers = HilbertIndices(record())
    column, row = ((ground[k] - BOX[0][k]) * 2**COARSE / 1000 for k in range(2))
    expected = int(hilbert_indices(COARSE, int(column), int(row)))
    for frame in record().frames:
        assert numbers.of(frame, DEEP, tile_at(frame, ground))[0] >> 2 * (GROUND_LEVEL - COARSE) == expected, frame.id


def test_ground_beside_the_scene_gets_the_nearest_square() -> None:
    numbers = HilbertIndices(record())
    for frame in record().frames:
        corners = np.array([[0, 0], [0, 7], [7, 0], [7, 7]])
        assert ((numbers.of(frame, 3, corners) >= 0) & (numbers.of(frame, 3, corners) < HILBERT_INDICES)).all()


def test_blocks_that_are_neighbours_on_the_curve_are_neighbours_on_the_ground() -> None:
    """The mean step over the blocks of four views is less than a block, and most steps lead to another view."""
    box: Box = ((0.0, 0.0, 0.0), (1000.0, 1000.0, 20.0))
    frames = tuple(pin(box, 256, 0.02, [ViewAngles(look_at, 45) for look_at in (0, 90, 180, 270)]))
    rendering = RenderingRecord("town-a", "town", 0.02, ((),), frames, box)
    numbers, found, level = HilbertIndices(rendering), [], 6
    places = np.stack([axis.ravel() for axis in np.meshgrid(np.arange(2**level), np.arange(2**level))], axis=1)
    centres = np.stack([axis.ravel() for axis in np.meshgrid(np.arange(5, 1000, 10.0), np.arange(5, 1000, 10.0))] + [np.full(10_000, 10.0)], axis=1)
    for frame in frames:
        uvd = uvd_from_local(frame.axes, centres)
        tile_m = frame.size_m / 2**level
        own = np.floor(np.stack([uvd[:, 0] - frame.u0_m, frame.v0_m - uvd[:, 1]], axis=1) / tile_m).astype(int)
        of_tile = dict(zip(map(tuple, places.tolist()), numbers.of(frame, level, places).tolist(), strict=True))
        for tile in {tuple(place) for place in own.tolist()}:
            inside = centres[(own == tile).all(axis=1)][:, :2].mean(axis=0)
            found.append((of_tile[tile], inside, frame.id))
    found.sort(key=lambda each: each[0])
    steps = [float(np.hypot(*(after - before))) for (_, before, _), (_, after, _) in pairwise(found)]
    assert np.mean(steps) < frames[0].size_m / 2**level
    changes = sum(before[2] != after[2] for before, after in pairwise(found))
    assert changes > len(found) / 2


def test_the_ground_of_a_window_has_finer_squares() -> None:
    window = Window(200.0, 400.0, 20.0)
    small = record(window)
    places = np.stack([axis.ravel() for axis in np.meshgrid(np.arange(8), np.arange(8))], axis=1)
    squares = {
        name: len(np.unique(HilbertIndices(each).of(small.frames[0], 3, places) >> 2 * (GROUND_LEVEL - COARSE)))
        for name, each in (("window", small), ("scene", record()))
    }
    assert squares["window"] > 4 * squares["scene"]
