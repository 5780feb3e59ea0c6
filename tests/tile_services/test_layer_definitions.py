"""QGIS and GDAL open the layer definitions of the server and of a published folder."""

import io
import shutil
import subprocess

import httpx
import numpy as np
import pytest
from PIL import Image
from pyproj import CRS, Transformer

from map3d.catalogue import Workspace
from map3d.publish import publish
from map3d.tiles.view_plane import plane_crs
from tests.tile_services.pyramid_pixels import difference, over_magenta
from tests.tile_services.qgis_process import qgis


@pytest.fixture(scope="session")
def folder(town, tmp_path_factory):
    """A published folder, opened from the file system."""
    out = tmp_path_factory.mktemp("published") / "map"
    publish(Workspace(town), "lit", out, gis=True)
    return out


def check_qgis(pixels, tmp_path, definition):
    frame, zmax = pixels.frame, pixels.manifest.zmax
    pixel_m = frame.pixel_m(zmax)
    left, top = frame.u0_m + 900 * pixel_m, frame.v0_m - 900 * pixel_m
    seen = qgis(tmp_path, definition=str(definition), extent=[left, top - 300 * pixel_m, left + 400 * pixel_m, top])
    assert (seen["valid"], seen["problems"], seen["geographic"]) == (True, [], False)
    assert "plane of view 35-40" in seen["crs"]
    with Image.open(seen["out"]) as image:
        got = np.asarray(image.convert("RGB"))
    assert difference(got, over_magenta(pixels.level("picture", zmax)[900:1200, 900:1300])) < 0.01


@pytest.mark.third_party
def test_qgis_opens_a_published_folder(pixels, folder, tmp_path):
    check_qgis(pixels, tmp_path, folder / "gis" / "35-40-picture.qlr")


@pytest.mark.third_party
def test_qgis_opens_the_definition_of_the_server(pixels, address, tmp_path):
    (tmp_path / "layer.qlr").write_bytes(httpx.get(f"{address}/gis/lit/35-40.qlr").content)
    check_qgis(pixels, tmp_path, tmp_path / "layer.qlr")


@pytest.mark.skipif(shutil.which("gdal_translate") is None, reason="GDAL is not installed: apt install gdal-bin")
@pytest.mark.third_party
@pytest.mark.parametrize("source", ["folder", "server"])
def test_gdal_reads_the_same_pixels(pixels, folder, address, tmp_path, source):
    text = (folder / "gis" / "35-40-picture.xml").read_bytes() if source == "folder" else httpx.get(f"{address}/gis/lit/35-40.xml").content
    (tmp_path / "source.xml").write_bytes(text)
    subprocess.run(["gdal_translate", "-q", "-of", "PNG", "-srcwin", "900", "900", "300", "300", "source.xml", "got.png"], cwd=tmp_path, check=True)
    with Image.open(io.BytesIO((tmp_path / "got.png").read_bytes())) as image:
        got = np.asarray(image.convert("RGBA"))
    want = pixels.level("picture", pixels.manifest.zmax)[900:1200, 900:1200]
    assert difference(got[want[..., 3] > 0], want[want[..., 3] > 0]) == 0


def test_the_height_of_the_reference_plane_can_be_chosen(pixels, address):
    height_m = pixels.manifest.origin[2] + 12.5
    east, north, _ = pixels.manifest.origin
    served = CRS.from_wkt(httpx.get(f"{address}/gis/lit/35-40.wkt", params={"height": height_m}).text)
    known = plane_crs(pixels.manifest, pixels.view, height_m)
    points = [Transformer.from_crs("EPSG:25832", crs, always_xy=True).transform(east, north) for crs in (served, known)]
    assert points[0] == pytest.approx(points[1], abs=1e-5)
    assert points[0][1] == pytest.approx(12.5 * pixels.frame.axes.up[2], abs=1e-5)


@pytest.mark.parametrize(
    ("path", "status"), [("35-40.wkt?height=nan", 400), ("35-40.wkt?height=1e9", 400), ("35-40.wkt?height=x", 400), ("35-40.exe", 404)]
)
def test_other_requests_are_refused(address, path, status):
    assert httpx.get(f"{address}/gis/lit/{path}").status_code == status
