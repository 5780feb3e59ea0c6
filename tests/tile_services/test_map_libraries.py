"""OpenLayers, Leaflet and MapLibre draw the services in Chromium, in a page of another origin."""

import numpy as np
import pytest
from PIL import Image

from tests.tile_services.pyramid_pixels import difference, over_magenta
from tests.whole.browsing import PLAYWRIGHT, browse, picture

pytestmark = pytest.mark.browser

COLUMN, ROW, WIDTH, HEIGHT = 760, 830, 600, 450
"""The part that the screenshot shows, in pixels of the deepest level. Its corners are outside the content."""


@pytest.mark.parametrize("client", ["openlayers wmts", "openlayers ogc", "leaflet", "maplibre"])
def test_pixels_are_those_of_the_pyramid(pixels, address, client):
    assert (PLAYWRIGHT.parent / {"openlayers": "ol", "maplibre": "maplibre-gl"}.get(client.split()[0], "leaflet")).is_dir(), "run make .cache/npm"
    frame, zmax = pixels.frame, pixels.manifest.zmax
    column, row, side = COLUMN + WIDTH // 2, ROW + HEIGHT // 2, 256 << zmax
    pixel_m = frame.pixel_m(zmax)
    screenshot = picture(f"{client.replace(' ', '-')}.png")
    seen = browse(
        "map_libraries.mjs",
        client=client,
        address=address,
        rendering="lit",
        view_id="35-40",
        view="lit:35-40",
        zmax=zmax,
        size=[WIDTH, HEIGHT],
        center=[frame.u0_m + column * pixel_m, frame.v0_m - row * pixel_m],
        pixel_m=pixel_m,
        square={"u0_m": frame.u0_m, "v0_m": frame.v0_m, "size_m": frame.size_m},
        lon_lat=[column / side * 360 - 180, float(np.degrees(np.arctan(np.sinh(np.pi * (1 - 2 * row / side)))))],
        screenshot=screenshot,
    )
    assert seen["problems"] == []
    with Image.open(screenshot) as image:
        got = np.asarray(image.convert("RGB"))
    want = over_magenta(pixels.level("picture", zmax)[ROW : ROW + HEIGHT, COLUMN : COLUMN + WIDTH])
    assert difference(got, want) < 0.02
