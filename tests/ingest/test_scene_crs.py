"""CRSs that a scene accepts."""

import pytest

from map3d.errors import CrsError
from map3d.geometry.crs import parse_crs
from map3d.ingest.scene_crs import to_scene_crs


def test_a_scene_needs_projected_metres() -> None:
    found = to_scene_crs(parse_crs("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH"))
    assert (found.epsg, found.name, found.vertical) == (25832, "ETRS89 / UTM zone 32N", "DHHN2016 height")
    assert found.wkt is not None
    assert not found.is_local
    for name in ("EPSG:4326", "EPSG:4979", "EPSG:2263"):
        with pytest.raises(CrsError, match="projected CRS in metres"):
            to_scene_crs(parse_crs(name))


def test_a_scene_crs_reads_back_from_its_wkt() -> None:
    first = to_scene_crs(parse_crs("EPSG:25832+7837"))
    assert first.wkt is not None
    assert to_scene_crs(parse_crs(first.wkt)) == first
