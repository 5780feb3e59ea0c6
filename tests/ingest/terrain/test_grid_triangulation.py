import numpy as np
import pytest

from map3d.errors import BadRequest
from map3d.ingest.terrain.grid_triangulation import compact_vertices, orient_up, triangulate_all, triangulate_sparse

SIDES = [1, 2, 4, 16, 64]


def grid(side, seed=0, gaps=0.0):
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0 : side + 1, 0 : side + 1] / max(side, 1)
    heights = 10 * np.sin(6 * x) * np.cos(5 * y) + random.normal(0, 0.2, x.shape)
    heights[random.random(x.shape) < gaps] = np.nan
    return heights


def vertex_positions(heights):
    rows, columns = heights.shape
    y, x = np.mgrid[0:rows, 0:columns]
    return np.stack([x.ravel(), -y.ravel(), heights.ravel()], axis=-1).astype(np.float64)


def doubled_areas(heights, triangles):
    a, b, c = (vertex_positions(heights)[triangles[:, k], :2] for k in range(3))
    return (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])


def edges(triangles):
    pairs = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    return np.unique(pairs, axis=0, return_counts=True)


def interpolated(heights, triangles):
    """Returns the heights of the triangles at the grid's vertices; NaN outside all triangles."""
    found = np.full(heights.size, np.nan)
    points = vertex_positions(heights)
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
    triangles = triangulate_all(heights)
    assert len(triangles) == 2 * side * side
    assert np.abs(doubled_areas(heights, triangles)).sum() == pytest.approx(2 * side * side)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("error", [0.0, 0.05, 0.5, 5.0, 1e9])
def test_sparse_triangles_cover_the_square_once_without_cracks(side, error):
    heights = grid(side)
    triangles = triangulate_sparse(heights, error)
    assert np.abs(doubled_areas(heights, triangles)).sum() == pytest.approx(2 * side * side)
    _, uses = edges(triangles)
    assert uses.max() <= 2
    assert (uses == 1).sum() == 4 * side


@pytest.mark.parametrize("error", [0.05, 0.3, 2.0])
def test_no_height_differs_by_more_than_the_error(error):
    heights = grid(32)
    assert np.abs(interpolated(heights, triangulate_sparse(heights, error)) - heights).max() <= error + 1e-9


def test_a_plane_needs_few_triangles_beyond_its_border():
    y, x = np.mgrid[0:65, 0:65]
    triangles = triangulate_sparse(0.5 * x + 0.25 * y, 0.01)
    assert len(triangles) < 2 * 64 * 64 / 6


def test_a_greater_error_needs_fewer_triangles():
    heights = grid(64)
    counts = [len(triangulate_sparse(heights, error)) for error in (0.0, 0.5, 1.0, 4.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 2 * counts[-1]


def test_all_border_vertices_stay_so_that_neighbours_match():
    heights = grid(32)
    used, _ = compact_vertices(triangulate_sparse(heights, 100.0))
    border = np.zeros((33, 33), dtype=bool)
    border[[0, -1]] = border[:, [0, -1]] = True
    assert set(np.flatnonzero(border)) <= set(used.tolist())


@pytest.mark.parametrize("gaps", [0.02, 0.3, 1.0])
@pytest.mark.parametrize("error", [0.1, 10.0])
def test_sparse_triangles_keep_all_gaps(gaps, error):
    heights = grid(32, seed=5, gaps=gaps)
    few, every = triangulate_sparse(heights, error), triangulate_all(heights)
    assert np.isfinite(heights.ravel()[few]).all()
    assert np.isfinite(heights.ravel()[every]).all()
    there = interpolated(heights, few)
    assert (np.isfinite(there) <= np.isfinite(heights)).all()
    assert np.nanmax(np.abs(there - heights), initial=0.0) <= error + 1e-9


def test_a_cell_without_one_corner_keeps_a_triangle():
    for row, column in [(0, 0), (0, 1), (1, 0), (1, 1)]:
        heights = np.zeros((2, 2))
        heights[row, column] = np.nan
        assert len(triangulate_all(heights)) == 1
    heights = np.array([[np.nan, 0.0], [0.0, np.nan]])
    assert len(triangulate_all(heights)) == 0


def test_cells_are_split_along_the_smaller_height_difference():
    ridge = np.array([[0.0, 5.0], [5.0, 0.0]])
    first, second = (set(triangle) for triangle in triangulate_all(ridge).tolist())
    assert first & second in ({1, 2}, {0, 3})


def test_triangles_face_up_for_any_axis_directions():
    heights = grid(4)
    triangles = triangulate_all(heights)
    for signs in [(1, 1), (-1, 1), (1, -1), (-1, -1)]:
        positions = vertex_positions(heights) * [*signs, 1]
        turned = orient_up(positions, triangles)
        normals = np.cross(positions[turned[:, 1]] - positions[turned[:, 0]], positions[turned[:, 2]] - positions[turned[:, 0]])
        assert (normals[:, 2] > 0).all()


@pytest.mark.parametrize("shape", [(4, 4), (5, 9), (1, 1), (6, 6)])
def test_grids_without_2k_plus_1_vertices_are_refused(shape):
    with pytest.raises(BadRequest):
        triangulate_sparse(np.zeros(shape), 1.0)
