"""GDAL reads the services, and places vector data on the right pixel."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from tests.tile_services.pyramid_pixels import difference

pytestmark = [
    pytest.mark.third_party,
    pytest.mark.skipif(shutil.which("gdalinfo") is None, reason="GDAL is not installed: apt install gdal-bin"),
]


def wmts(address, layer="lit:35-40"):
    return f"WMTS:{address}/wmts/1.0.0/WMTSCapabilities.xml,layer={layer}"


def gdal(tmp_path, *command, given=None):
    done = subprocess.run(command, input=given, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    assert "ERROR" not in done.stderr
    return done.stdout


def ogcapi(pixels, address, collection="lit:35-40"):
    """Returns open options and the name. GDAL 3.6 takes the longitudes and latitudes of the extent for coordinates of the tile matrix set."""
    frame = pixels.frame
    left, bottom, right, top = frame.u0_m, frame.v0_m - frame.size_m, frame.u0_m + frame.size_m, frame.v0_m
    if collection.endswith("pseudo-mercator"):
        left, bottom, right, top = -20037508.34, -20037508.34, 20037508.34, 20037508.34
    options = []
    for name, value in (("MINX", left), ("MINY", bottom), ("MAXX", right), ("MAXY", top)):
        options += ["-oo", f"{name}={value}"]
    return [*options, f"OGCAPI:{address}/ogc/collections/{collection}"]


def test_wmts_has_the_grid_of_the_pyramid(pixels, address, tmp_path):
    info = json.loads(gdal(tmp_path, "gdalinfo", "-json", wmts(address)))
    left, width, _, top, _, height = info["geoTransform"]
    assert (width, -height) == pytest.approx((pixels.frame.pixel_m(pixels.manifest.zmax),) * 2)
    for offset in ((left - pixels.frame.u0_m) / width, (pixels.frame.v0_m - top) / width):
        assert offset / 256 == pytest.approx(round(offset / 256), abs=1e-6)
    assert "DERIVEDPROJCRS" in info["coordinateSystem"]["wkt"]


@pytest.mark.parametrize("source", ["wmts", "ogcapi", "wmts color"])
def test_pixels_are_those_of_the_pyramid(pixels, address, tmp_path, source):
    frame, zmax = pixels.frame, pixels.manifest.zmax
    column, row, size = 900, 900, 300
    left, top = frame.u0_m + column * frame.pixel_m(zmax), frame.v0_m - row * frame.pixel_m(zmax)
    window = ["-projwin", left, top, left + size * frame.pixel_m(zmax), top - size * frame.pixel_m(zmax)]
    names = {"wmts": [wmts(address)], "wmts color": [wmts(address) + ",style=color"], "ogcapi": ogcapi(pixels, address)}
    gdal(tmp_path, "gdal_translate", "-q", "-of", "PNG", *map(str, window), *names[source], "got.png")
    with Image.open(tmp_path / "got.png") as picture:
        got = np.asarray(picture.convert("RGBA"))
    layer = "color" if source == "wmts color" else "picture"
    want = pixels.level(layer, zmax)[row : row + size, column : column + size]
    assert got.shape == want.shape
    assert difference(got[want[..., 3] > 0], want[want[..., 3] > 0]) == 0
    assert (want[..., 3] > 0).mean() > 0.5


def test_an_upper_level_is_read_for_an_overview(pixels, address, tmp_path):
    gdal(tmp_path, "gdal_translate", "-q", "-of", "PNG", "-outsize", "12.5%", "12.5%", wmts(address), "got.png")
    with Image.open(tmp_path / "got.png") as picture:
        got = np.asarray(picture.convert("RGBA"))
    info = json.loads(gdal(tmp_path, "gdalinfo", "-json", wmts(address)))
    pixel_m = pixels.frame.pixel_m(0)
    column, row = round((info["geoTransform"][0] - pixels.frame.u0_m) / pixel_m), round((pixels.frame.v0_m - info["geoTransform"][3]) / pixel_m)
    want = pixels.level("picture", 0)[row : row + got.shape[0], column : column + got.shape[1]]
    assert difference(got[want[..., 3] > 250], want[want[..., 3] > 250]) == 0


def test_a_building_corner_falls_on_its_pixel(pixels, address, tmp_path):
    """A point in EPSG:25832, with the height of the reference plane, through the CRS that the service publishes."""
    info = json.loads(gdal(tmp_path, "gdalinfo", "-json", wmts(address)))
    (tmp_path / "plane.wkt").write_text(info["coordinateSystem"]["wkt"])
    manifest, frame = pixels.manifest, pixels.frame
    ground_m = manifest.origin[2] + manifest.box[0][2]
    rows, columns = np.nonzero(np.isfinite(pixels.depth()))
    for k in np.linspace(0, len(rows) - 1, 40).astype(int):
        column, row = int(columns[k]), int(rows[k])
        east, north, height = pixels.world(column, row)
        out = gdal(tmp_path, "gdaltransform", "-s_srs", "EPSG:25832", "-t_srs", "plane.wkt", given=f"{float(east)!r} {float(north)!r}\n")
        u, v = map(float, out.split()[:2])
        px, py = frame.level_pixel_from_uv(manifest.zmax, u, v + (height - ground_m) * frame.axes.up[2])
        assert (float(px), float(py)) == pytest.approx((column + 0.5, row + 0.5), abs=0.01)


def test_pseudo_web_mercator_opens_with_its_own_extent(address, pixels, tmp_path):
    info = json.loads(gdal(tmp_path, "gdalinfo", "-json", wmts(address, "lit:35-40:pseudo-mercator")))
    assert "3857" in info["coordinateSystem"]["wkt"]
    assert json.loads(gdal(tmp_path, "gdalinfo", "-json", *ogcapi(pixels, address, "lit:35-40:pseudo-mercator")))["size"] == [2048, 2048]


def test_subdatasets_name_every_layer(address, tmp_path):
    text = gdal(tmp_path, "gdalinfo", f"WMTS:{address}/wmts/1.0.0/WMTSCapabilities.xml")
    for layer in ("lit:35-40", "lit:35-40:pseudo-mercator"):
        assert f"layer={layer}," in text
