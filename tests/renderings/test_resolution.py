"""The resolution of a site: finer for small content, coarser for large content, and no finer than its surfaces."""

import json
from contextlib import closing

import pytest

from map3d import _core
from map3d.catalogue import Workspace
from map3d.cli.app import run
from map3d.scenes.build import build
from map3d.site.resolution import CITY_PIXEL_M, MAX_SMALL_BASE_TILES, SurfaceDetail, choose_resolution
from map3d.types import AO_RADIUS_M, ViewAngles

VIEWS = [ViewAngles(look_at, 45) for look_at in (0, 90, 180, 270)]


def cube(folder, side_m):
    """Writes a cube as an OBJ file."""
    corners = [(x, y, z) for z in (0, side_m) for y in (0, side_m) for x in (0, side_m)]
    faces = [(1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f " + " ".join(map(str, face)) for face in faces]
    folder.mkdir()
    (folder / "cube.obj").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    """By the side of a cube in metres: its built scene."""
    home = tmp_path_factory.mktemp("cubes")
    out = {}
    for side_m in (0.3, 1.5, 60.0, 1_500.0):
        name, workspace = f"cube{len(out)}", str(home / "workspace")
        assert run(["create-scene", name, "-w", workspace]) == 0
        assert run(["add-files", name, str(cube(home / name, side_m)), "--crs", "local", "-w", workspace]) == 0
        opened = Workspace(home / "workspace")
        with closing(opened.open_catalogue()) as catalogue:
            build(opened, catalogue, name, threads=1, max_memory_bytes=1 << 30)
        out[side_m] = _core.Scene(str(opened.scene_folder(name)), 1 << 28)
    return out


FINE = SurfaceDetail(None, 0.01)


@pytest.mark.parametrize(("side_m", "res_m"), [(0.3, 0.002), (1.5, 0.002), (60.0, 0.02), (1_500.0, 0.1)])
def test_small_content_has_small_pixels(scenes, side_m, res_m):
    chosen = choose_resolution(scenes[side_m], VIEWS, FINE)
    assert chosen.res_m == res_m
    if res_m < CITY_PIXEL_M:
        assert side_m / chosen.res_m > 100


def test_pixels_are_no_finer_than_the_surfaces_need(scenes):
    chosen = choose_resolution(scenes[1.5], VIEWS, SurfaceDetail(None, 1.28))
    assert chosen.res_m == 0.02
    assert "triangles of about 1.28 m" in chosen.why


def test_the_reason_names_the_limit_of_small_pixels(scenes):
    assert f"0.01 m would need more than {MAX_SMALL_BASE_TILES:,} tiles" in choose_resolution(scenes[60.0], VIEWS, FINE).why


def test_the_ground_plane_of_small_content_is_small(scenes):
    lo, hi = scenes[0.3].box
    assert hi[0] - lo[0] == pytest.approx(0.3 * 1.5, abs=0.01)
    lo, hi = scenes[60.0].box
    assert hi[0] - lo[0] == pytest.approx(80.0, abs=0.01)


def test_a_site_of_a_find_shows_it_large_and_not_dark_all_over(tmp_path):
    folder = cube(tmp_path / "find", 0.3)
    assert run(["site", str(folder), "-o", str(tmp_path / "out"), "--crs", "local", "--view", "0/45", "-w", str(tmp_path / "workspace")]) == 0
    manifest = json.loads((tmp_path / "out" / "rendering.json").read_text())
    (radius_m,) = {layer["radius_m"] for layer in manifest["layers"] if layer["kind"] == "ao"}
    assert radius_m == AO_RADIUS_M[0]
