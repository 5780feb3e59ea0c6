"""OWSLib, the OGC client library for Python, reads the services."""

import io

import numpy as np
import pytest
from PIL import Image

owslib = pytest.importorskip("owslib", reason="OWSLib is not installed: pip install owslib")
pytestmark = pytest.mark.third_party


def test_wmts(address, pixels):
    from owslib.wmts import WebMapTileService

    service = WebMapTileService(f"{address}/wmts/1.0.0/WMTSCapabilities.xml")
    assert set(service.contents) == {"lit:35-40", "lit:35-40:pseudo-mercator"}
    layer = service.contents["lit:35-40"]
    assert layer.styles["picture"]["isDefault"]
    for row, column in ((0, 0), (1, 1)):
        tile = service.gettile(
            layer="lit:35-40", style="picture", tilematrixset="lit:35-40", tilematrix="1", row=row, column=column, format="image/png"
        )
        with Image.open(io.BytesIO(tile.read())) as picture:
            got = np.asarray(picture.convert("RGBA"))
        assert np.array_equal(got, pixels.level("picture", 1)[256 * row : 256 * row + 256, 256 * column : 256 * column + 256])


def test_ogc_api_collections(address):
    from owslib.ogcapi import Collections

    service = Collections(f"{address}/ogc/")
    assert "lit:35-40" in [row["id"] for row in service.collections()["collections"]]
    assert service.collection("lit:35-40")["title"] == "Lit <town>: view 35-40"
    assert service.conformance()["conformsTo"]
