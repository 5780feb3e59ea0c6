"""The ground between bases goes through them, continues beyond them, and does not follow strays."""

import numpy as np

from map3d.ingest.ground_grid import STEP_M, GroundGrid

EAST, NORTH = 691_000.0, 5_336_000.0


def slope(x: np.ndarray) -> np.ndarray:
    return 500.0 + (x - EAST) / 50.0


def bases(count: int = 400) -> np.ndarray:
    random = np.random.default_rng(3)
    x, y = EAST + random.uniform(0, 1000, count), NORTH + random.uniform(0, 800, count)
    return np.column_stack([x, y, slope(x)])


def test_the_ground_goes_through_the_bases() -> None:
    points = bases()
    grid = GroundGrid.of_bases(points)
    assert grid is not None
    assert np.abs(grid.at(points[:, 0], points[:, 1]) - points[:, 2]).max() < 1.0


def test_gaps_are_filled_and_the_edge_continues() -> None:
    points = bases()
    grid = GroundGrid.of_bases(points[(points[:, 0] < EAST + 300) | (points[:, 0] > EAST + 600)])
    assert grid is not None
    x = np.array([EAST + 450.0, EAST - 5000.0, EAST + 9000.0])
    found = grid.at(x, np.full(3, NORTH + 400.0))
    assert np.allclose(found, [509.0, 500.0, 520.0], atol=3.0)


def test_strays_do_not_move_the_ground() -> None:
    points = bases()
    strays = np.array([[EAST + 500, NORTH + 400, -20.0], [EAST + 400, NORTH + 300, 9999.0], [0.0, 0.0, 0.0], [EAST, np.nan, 500.0]])
    one, other = GroundGrid.of_bases(points), GroundGrid.of_bases(np.concatenate([points, strays]))
    assert one is not None
    assert other is not None
    assert one.digest == other.digest


def test_small_changes_do_not_change_the_ground() -> None:
    points = np.column_stack([np.full(9, EAST), NORTH + np.arange(9) * 40.0, np.full(9, 510.0)])
    one, other = GroundGrid.of_bases(points), GroundGrid.of_bases(points + np.array([0.0, 0.0, STEP_M / 4]))
    assert one is not None
    assert other is not None
    assert one.digest == other.digest == GroundGrid.load(one.document).digest


def test_one_base_is_a_ground_and_none_is_none() -> None:
    grid = GroundGrid.of_bases(np.array([[EAST, NORTH, 77.0]]))
    assert grid is not None
    assert grid.at(np.array([0.0]), np.array([0.0])).tolist() == [77.0]
    assert GroundGrid.of_bases(np.empty((0, 3))) is None
    positions, triangles = grid.mesh()
    assert (positions[:, 2] == 77.0).all()
    assert triangles.max() == len(positions) - 1
