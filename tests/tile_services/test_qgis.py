"""QGIS draws the services, and vector data in EPSG:25832 over them."""

from urllib.parse import quote

import numpy as np
import pytest
from PIL import Image
from pyproj import Transformer

from map3d.tiles.view_plane import plane_crs
from tests.tile_services.pyramid_pixels import difference, over_magenta
from tests.tile_services.qgis_process import qgis

pytestmark = pytest.mark.third_party


def picture(seen):
    with Image.open(seen["out"]) as image:
        return np.asarray(image.convert("RGB"))


def window(frame, zmax, column, row, width, height):
    """Returns the extent of pixels of the deepest level."""
    pixel_m = frame.pixel_m(zmax)
    left, top = frame.u0_m + column * pixel_m, frame.v0_m - row * pixel_m
    return [left, top - height * pixel_m, left + width * pixel_m, top]


def wmts_through_gdal(address):
    return {"provider": "gdal", "source": f"WMTS:{address}/wmts/1.0.0/WMTSCapabilities.xml,layer=lit:35-40"}


def test_wmts_through_gdal_is_in_the_plane_of_the_view(pixels, address, tmp_path):
    frame, zmax = pixels.frame, pixels.manifest.zmax
    seen = qgis(tmp_path, **wmts_through_gdal(address), extent=window(frame, zmax, 900, 900, 400, 300))
    assert (seen["valid"], seen["problems"], seen["geographic"]) == (True, [], False)
    assert "plane of view 35-40" in seen["crs"]
    assert difference(picture(seen), over_magenta(pixels.level("picture", zmax)[900:1200, 900:1300])) < 0.01


def test_a_point_of_vector_data_falls_on_its_pixel(pixels, address, tmp_path):
    """The corner of a building at the ground, as a surveyor's file has it: EPSG:25832, transformed by QGIS itself."""
    frame, manifest = pixels.frame, pixels.manifest
    east, north = (float(manifest.origin[k] + manifest.box[0][k] * 0.2) for k in (0, 1))
    u, v = Transformer.from_crs("EPSG:25832", _plane(pixels), always_xy=True).transform(east, north)
    px, py = (float(value) for value in frame.level_pixel_from_uv(manifest.zmax, u, v))
    local = np.array([east, north, manifest.origin[2] + manifest.box[0][2]]) - manifest.origin
    assert (px, py) == pytest.approx(tuple(map(float, frame.level_pixel_from_local(manifest.zmax, local)[:2])), abs=1e-3)
    left, top = int(px) - 200, int(py) - 150
    extent = window(frame, manifest.zmax, left, top, 400, 300)
    seen = qgis(tmp_path, **wmts_through_gdal(address), extent=extent, crs="EPSG:25832", point=[east, north])
    rows, columns = np.nonzero((picture(seen) == (0, 255, 0)).all(axis=-1))
    assert len(rows) >= 9
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((px - left, py - top), abs=1.0)


def _plane(pixels):
    return plane_crs(pixels.manifest, pixels.view)


@pytest.mark.parametrize("service", ["wmts", "xyz"])
@pytest.mark.parametrize("suffix", ["png", "webp"])
def test_pseudo_web_mercator_is_drawn_by_the_provider_of_qgis(pixels, address, tmp_path, service, suffix):
    zmax = pixels.manifest.zmax
    if service == "xyz":
        source = "type=xyz&zmin=0&zmax=3&url=" + quote(f"{address}/xyz/lit/35-40/{{z}}/{{x}}/{{y}}.{suffix}", safe="")
    else:
        capabilities = quote(f"{address}/wmts/1.0.0/WMTSCapabilities.xml", safe="")
        source = (
            f"crs=EPSG:3857&format=image/{suffix}&layers=lit:35-40:pseudo-mercator&styles=picture&tileMatrixSet=WebMercatorQuad&url={capabilities}"
        )
    half = 20037508.342789244
    side = 2 * half / (256 << zmax)
    extent = [-half + 900 * side, half - 1200 * side, -half + 1300 * side, half - 900 * side]
    seen = qgis(tmp_path, provider="wms", source=source, extent=extent, size=[800, 600])
    assert (seen["valid"], seen["problems"]) == (True, [])
    got, level = picture(seen)[::2, ::2], over_magenta(pixels.level("picture", zmax))
    shifts = {(dx, dy): difference(got, level[900 + dy : 1200 + dy, 900 + dx : 1300 + dx]) for dx in (-1, 0, 1) for dy in (-1, 0, 1)}
    assert min(shifts, key=shifts.__getitem__) == (0, 0)
    assert shifts[0, 0] < 0.1
