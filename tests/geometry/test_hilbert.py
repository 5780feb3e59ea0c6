"""Laws of Hilbert indices."""

import numpy as np
import pytest

from map3d.geometry.hilbert import MAX_LEVEL, hilbert_indices


@pytest.mark.parametrize("level", range(8))
def test_consecutive_squares_share_a_side_and_each_has_one_number(level: int) -> None:
    x, y = (places.ravel() for places in np.meshgrid(np.arange(2**level), np.arange(2**level)))
    numbers = hilbert_indices(level, x, y)
    along = np.argsort(numbers)
    assert numbers[along].tolist() == list(range(4**level))
    assert (np.abs(np.diff(x[along])) + np.abs(np.diff(y[along])) == 1).all()


def test_the_curve_of_two_squares_a_side_is_the_one_of_the_books() -> None:
    assert hilbert_indices(1, [0, 0, 1, 1], [0, 1, 1, 0]).tolist() == [0, 1, 2, 3]


def test_all_squares_of_a_quadrant_are_consecutive() -> None:
    x, y = (places.ravel() for places in np.meshgrid(np.arange(64), np.arange(64)))
    numbers, quadrant = hilbert_indices(6, x, y), (x // 8) * 8 + y // 8
    for square in range(64):
        own = np.sort(numbers[quadrant == square])
        assert own[0] % 64 == 0
        assert own[-1] - own[0] == 63


def test_the_deepest_level_fits_into_64_bits() -> None:
    last = 2**MAX_LEVEL - 1
    assert hilbert_indices(MAX_LEVEL, [0, last], [0, 0]).tolist() == [0, 4**MAX_LEVEL - 1]
