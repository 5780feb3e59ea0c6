"""The default resolution follows the source: pixels are not much finer than texels and triangles; the choice is said with its reason."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from map3d.catalogue import Workspace
from map3d.site.resolution import SurfaceDetail, surface_detail
from tests.cli.towns import Run

pytestmark = pytest.mark.whole


def textured_quad(folder: Path, side_m: float, pixels: int) -> None:
    """Writes a horizontal square with one texture."""
    folder.mkdir()
    noise = np.random.default_rng(1).integers(0, 255, (pixels, pixels, 3), dtype=np.uint8)
    Image.fromarray(noise).save(folder / "photo.png")
    (folder / "quad.mtl").write_text("newmtl photo\nmap_Kd photo.png\n")
    corners = "".join(f"v {x} {y} 0\n" for x, y in ((0, 0), (side_m, 0), (side_m, side_m), (0, side_m)))
    (folder / "quad.obj").write_text(f"mtllib quad.mtl\n{corners}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl photo\nf 1/1 2/2 3/3 4/4\n")


def test_pixels_are_half_as_large_as_coarse_texels(run: Run, tmp_path: Path) -> None:
    """A quarter of a square kilometre with texels of 8 m: pixels of 0.1 m would make thousands of tiles of nothing."""
    textured_quad(tmp_path / "land", 512.0, 64)
    status, out, err = run("site", "land", "-o", "out", "--view", "0-45")
    assert status == 0, err
    why = "the surfaces have texels of about 8 m and triangles of about 362 m, so that finer pixels would show nothing more"
    assert f"5 m per pixel, since {why}" in out
    assert Workspace(tmp_path / "workspace").open_catalogue().rendering("land").res_m == 5.0
    assert "still to render: " in out


NOT_TERRAIN = np.zeros(4, bool)


def test_triangles_of_terrain_count_only_without_others() -> None:
    areas, texels, terrain = np.array([12.5, 12.5, 12.5, 64.0]), np.full(4, np.nan), np.array([True, True, True, False])
    assert surface_detail(areas, texels, terrain) == SurfaceDetail(None, 8.0)
    bare = surface_detail(areas[:3], texels[:3], terrain[:3])
    assert bare == SurfaceDetail(None, 12.5**0.5, 16)
    assert bare.pixel_m == pytest.approx(0.22, abs=0.001)


def test_detail_is_that_of_finer_texels_and_usual_triangles() -> None:
    areas, texels = np.array([100.0, 100.0, 1.0, 0.0]), np.array([0.2, 0.4, np.nan, 0.001])
    detail = surface_detail(areas, texels, NOT_TERRAIN[:4])
    assert detail == SurfaceDetail(0.2, 10.0)
    assert detail.pixel_m == 0.1


def test_textures_of_few_surfaces_do_not_count() -> None:
    detail = surface_detail(np.array([100.0, 100.0, 1.0]), np.array([np.nan, np.nan, 0.01]), NOT_TERRAIN[:3])
    assert detail == SurfaceDetail(None, 10.0)
    assert detail.pixel_m == 10.0 / 64


def test_nothing_has_no_detail() -> None:
    assert surface_detail(np.array([]), np.array([]), NOT_TERRAIN[:0]) is None
    assert surface_detail(np.array([0.0]), np.array([np.nan]), NOT_TERRAIN[:1]) is None


def test_face_with_a_bad_texture_index_keeps_its_geometry(run: Run, tmp_path: Path) -> None:
    textured_quad(tmp_path / "land", 20.0, 16)
    path = tmp_path / "land" / "quad.obj"
    path.write_text(path.read_text() + "f 1/1 2/9 3/3\nf 1/1/5 2/2/5 3/3/5\nf 1/x 3/3 4/4\nf 1/1 2/2 9/3\n")
    run("create-scene", "town")
    status, out, err = run("add-files", "town", "land/quad.obj")
    assert status == 0, err
    assert "Faces that refer to missing texture coordinates, drawn without a texture: 2. Example: line 12" in out
    assert "Faces that refer to missing normals, which are computed instead: 1. Example: line 13" in out
    assert "quad   obj           1          5        1" in out
