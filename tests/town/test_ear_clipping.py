"""Laws of ear clipping: the triangles cover the polygon without overlap."""

import numpy as np
import pytest

from map3d_town.writers.ear_clipping import triangulate_with_holes

SQUARE = np.array([(0, 0), (10, 0), (10, 10), (0, 10)], dtype=float)


def area(points: np.ndarray) -> float:
    x, y = points[:, 0], points[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def hole(x: float, y: float, side: float) -> np.ndarray:
    return np.array([(x, y), (x, y + side), (x + side, y + side), (x + side, y)])


@pytest.mark.parametrize(
    "holes",
    [
        [],
        [hole(4, 4, 2)],
        [hole(1, 1, 1), hole(7, 1, 1), hole(1, 7, 1)],
        [hole(1 + 2 * i, 1 + 2 * j, 1.0) for i in range(4) for j in range(4)],
        [hole(1, 4, 2), hole(3, 4, 2), hole(6, 4, 2)],
    ],
)
def test_triangles_cover_the_polygon_once(holes: list[np.ndarray]) -> None:
    rings = [SQUARE, *holes]
    points = np.concatenate(rings)
    pieces = [area(points[t]) for t in triangulate_with_holes(rings)]
    assert min(pieces) > 0
    assert sum(pieces) == pytest.approx(100 + sum(area(h) for h in holes))


def test_clockwise_polygon_keeps_its_orientation() -> None:
    rings = [SQUARE[::-1], hole(4, 4, 2)[::-1]]
    points = np.concatenate(rings)
    pieces = [area(points[t]) for t in triangulate_with_holes(rings)]
    assert max(pieces) < 0
    assert sum(pieces) == pytest.approx(-96)
