"""Laws of the teatime scene."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from map3d_town.teatime import write_teatime
from map3d_town.teatime.teapot import ClosedMesh, bezier, signed_volume, teapot
from map3d_town.teatime.teatime_scene import CUBE_CENTRE, CUBE_SIDE, cube


@pytest.fixture(scope="module", params=["teapot", "cube"])
def mesh(request: pytest.FixtureRequest) -> ClosedMesh:
    return teapot(8.0, 8) if request.param == "teapot" else cube()


def test_every_edge_is_shared_by_two_triangles_in_opposite_directions(mesh: ClosedMesh) -> None:
    edges = Counter((int(t[i]), int(t[(i + 1) % 3])) for t in mesh.triangles for i in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)


def test_volume_is_positive(mesh: ClosedMesh) -> None:
    assert signed_volume(mesh.points, mesh.triangles) > 0


def test_normals_are_unit_and_agree_with_the_winding(mesh: ClosedMesh) -> None:
    assert np.allclose(np.linalg.norm(mesh.normals, axis=2), 1)
    a, b, c = (mesh.points[mesh.triangles[:, i]] for i in range(3))
    flat = np.cross(b - a, c - a)
    assert np.all(np.einsum("ik,ijk->ij", flat, mesh.normals) > 0)


def test_teapot_stands_on_the_origin() -> None:
    points = teapot(8.0, 8).points
    assert points[:, 2].min() == 0
    assert np.allclose(points[:, 1].min(), -points[:, 1].max())
    assert np.hypot(*points[points[:, 2] == 0][:, :2].T).min() == 0


def test_teapot_is_smooth_where_patches_meet() -> None:
    pot = teapot(1.0, 8)
    corners = pot.points[pot.triangles]
    x, y, z = corners[..., 0], corners[..., 1], corners[..., 2]
    belt = np.isclose(z, 0.9) & np.isclose(np.hypot(x, y), 2.0, atol=0.01) & (x > -1.9)
    radial = corners[belt] * [1, 1, 0] / 2.0
    assert belt.sum() > 100
    assert np.sum(radial * pot.normals[belt], axis=1).min() > 0.95


def test_teapot_and_cube_do_not_touch() -> None:
    assert teapot(8.0, 8).points[:, 0].max() < CUBE_CENTRE[0] - CUBE_SIDE / 2


def test_patch_contains_its_corners() -> None:
    control = np.random.default_rng(1).normal(size=(4, 4, 3))
    surface = bezier(control, 5)
    assert np.allclose(surface[[0, 0, -1, -1], [0, -1, 0, -1]], control[[0, 0, -1, -1], [0, -1, 0, -1]])


def test_two_runs_write_the_same_bytes(tmp_path: Path) -> None:
    write_teatime(tmp_path / "a")
    write_teatime(tmp_path / "b")
    names = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert names == ["cube.obj", "teapot.obj", "teatime.mtl"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_materials_of_the_objects_exist(tmp_path: Path) -> None:
    write_teatime(tmp_path)
    for name in ("teapot", "cube"):
        used = [line for line in (tmp_path / f"{name}.obj").read_text().splitlines() if line.startswith("usemtl")]
        assert used
        assert all(f"newmtl {line.split()[1]}" in (tmp_path / "teatime.mtl").read_text() for line in used)
