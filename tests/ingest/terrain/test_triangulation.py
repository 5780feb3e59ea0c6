import numpy as np
import pytest

from map3d.errors import BadRequest
from map3d.ingest.terrain.triangulation import all_triangles, facing_up, few_triangles, used_vertices

SIDES = [1, 2, 4, 16, 64]


def grid(side, seed=0, gaps=0.0):
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0 : side + 1, 0 : side + 1] / max(side, 1)
    heights = 10 * np.sin(6 * x) * np.cos(5 * y) + random.normal(0, 0.2, x.shape)
    heights[random.random(x.shape) < gaps] = np.nan
    return heights


def places(heights):
    rows, columns = heights.shape
    y, x = np.mgrid[0:rows, 0:columns]
    return np.stack([x.ravel(), -y.ravel(), heights.ravel()], axis=-1).astype(np.float64)


def doubled_areas(heights, triangles):
    a, b, c = (places(heights)[triangles[:, k], :2] for k in range(3))
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def edges(triangles):
    pairs = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    return np.unique(pairs, axis=0, return_counts=True)


def interpolated(heights, triangles):
    """Heights at the grid's vertices as the triangles have them; NaN where no triangle is."""
    found = np.full(heights.size, np.nan)
    points = places(heights)
    for a, b, c in points[triangles.astype(int)]:
        low, high = np.minimum(np.minimum(a, b), c)[:2], np.maximum(np.maximum(a, b), c)[:2]
        xs, ys = np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1))
        matrix = np.array([[b[0] - a[0], c[0] - a[0]], [b[1] - a[1], c[1] - a[1]]])
        s, t = np.linalg.solve(matrix, np.stack([xs.ravel() - a[0], ys.ravel() - a[1]]))
        inside = (s >= -1e-9) & (t >= -1e-9) & (s + t <= 1 + 1e-9)
        number = (-ys.ravel() * heights.shape[1] + xs.ravel())[inside].astype(int)
        found[number] = (a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2]))[inside]
    return found.reshape(heights.shape)


@pytest.mark.parametrize("side", SIDES)
def test_all_triangles_cover_the_square_once(side):
    heights = grid(side)
    triangles = all_triangles(heights)
    assert len(triangles) == 2 * side * side
    assert np.abs(doubled_areas(heights, triangles)).sum() == pytest.approx(2 * side * side)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("error", [0.0, 0.05, 0.5, 5.0, 1e9])
def test_few_triangles_cover_the_square_once_without_cracks(side, error):
    heights = grid(side)
    triangles = few_triangles(heights, error)
    assert np.abs(doubled_areas(heights, triangles)).sum() == pytest.approx(2 * side * side)
    _, uses = edges(triangles)
    assert uses.max() <= 2
    assert (uses == 1).sum() == 4 * side


@pytest.mark.parametrize("error", [0.05, 0.3, 2.0])
def test_no_height_differs_by_more_than_the_error(error):
    heights = grid(32)
    assert np.abs(interpolated(heights, few_triangles(heights, error)) - heights).max() <= error + 1e-9


def test_a_plane_needs_hardly_more_than_its_border():
    y, x = np.mgrid[0:65, 0:65]
    triangles = few_triangles(0.5 * x + 0.25 * y, 0.01)
    assert len(triangles) < 2 * 64 * 64 / 6


def test_a_greater_error_needs_fewer_triangles():
    heights = grid(64)
    counts = [len(few_triangles(heights, error)) for error in (0.0, 0.5, 1.0, 4.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 2 * counts[-1]


def test_the_border_is_kept_so_that_neighbours_fit():
    heights = grid(32)
    used, _ = used_vertices(few_triangles(heights, 100.0))
    border = np.zeros((33, 33), dtype=bool)
    border[[0, -1]] = border[:, [0, -1]] = True
    assert set(np.flatnonzero(border)) <= set(used.tolist())


@pytest.mark.parametrize("gaps", [0.02, 0.3, 1.0])
@pytest.mark.parametrize("error", [0.1, 10.0])
def test_gaps_are_the_same_with_few_and_with_all(gaps, error):
    heights = grid(32, seed=5, gaps=gaps)
    few, every = few_triangles(heights, error), all_triangles(heights)
    assert np.isfinite(heights.ravel()[few]).all()
    assert np.isfinite(heights.ravel()[every]).all()
    there = interpolated(heights, few)
    assert (np.isfinite(there) <= np.isfinite(heights)).all()
    assert np.nanmax(np.abs(there - heights), initial=0.0) <= error + 1e-9


def test_a_cell_that_misses_a_corner_keeps_a_triangle():
    for row, column in [(0, 0), (0, 1), (1, 0), (1, 1)]:
        heights = np.zeros((2, 2))
        heights[row, column] = np.nan
        assert len(all_triangles(heights)) == 1
    heights = np.array([[np.nan, 0.0], [0.0, np.nan]])
    assert len(all_triangles(heights)) == 0


def test_cells_are_cut_along_the_smaller_step():
    ridge = np.array([[0.0, 5.0], [5.0, 0.0]])
    assert {1, 2} <= set(all_triangles(ridge)[0].tolist()) & set(all_triangles(ridge)[1].tolist()) or {0, 3} <= set(all_triangles(ridge)[0].tolist())
    shared = set(all_triangles(ridge)[0].tolist()) & set(all_triangles(ridge)[1].tolist())
    assert shared in ({1, 2}, {0, 3})


def test_triangles_face_up_whatever_the_axes():
    heights = grid(4)
    triangles = all_triangles(heights)
    for signs in [(1, 1), (-1, 1), (1, -1), (-1, -1)]:
        positions = places(heights) * [*signs, 1]
        turned = facing_up(positions, triangles)
        normals = np.cross(positions[turned[:, 1]] - positions[turned[:, 0]], positions[turned[:, 2]] - positions[turned[:, 0]])
        assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("shape", [(4, 4), (5, 9), (1, 1), (6, 6)])
def test_grids_that_cannot_be_halved_are_refused(shape):
    with pytest.raises(BadRequest):
        few_triangles(np.zeros(shape), 1.0)
