"""Parsing of CRS names."""

import numpy as np
import pytest
from pyproj import CRS

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs, vertical_crs, vertical_crs_name
from map3d.geometry.transformations import find_transformation


@pytest.mark.parametrize(
    ("name", "horizontal", "vertical"),
    [
        ("EPSG:25832", 25832, None),
        ("epsg:25832", 25832, None),
        ("urn:ogc:def:crs:EPSG::25832", 25832, None),
        ("urn:ogc:def:crs:EPSG:6.12:31256", 31256, None),
        ("http://www.opengis.net/def/crs/EPSG/0/3068", 3068, None),
        ("http://www.opengis.net/gml/srs/epsg.xml#31467", 31467, None),
        ("urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::5783", 25832, 5783),
        ("urn:ogc:def:crs,crs:EPSG:6.12:31256,crs:EPSG:6.12:5778", 31256, 5778),
        ("urn:ogc:def:crs:EPSG:25832, crs:EPSG:5783", 25832, 5783),
        ("urn:ogc:def:crs, crs:EPSG::25832, crs:EPSG::5783", 25832, 5783),
        ("EPSG:25832+5783", 25832, 5783),
        ("EPSG::25832*EPSG::5783", 25832, 5783),
        (
            "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/EPSG/0/25833&2=http://www.opengis.net/def/crs/EPSG/0/7837",
            25833,
            7837,
        ),
        ("urn:adv:crs:ETRS89_UTM32", 25832, None),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH", 25832, 7837),
        ("urn:adv:crs:ETRS89_UTM33*DE_DHHN92_NH", 25833, 5783),
        ("urn:adv:crs:DE_DHDN_3GK4*DE_DHHN92_NH", 31468, 5783),
        ("urn:adv:crs:DE_DHDN_3GK4*DE_DHN92_NH", 31468, 5783),
        ("urn:adv:crs:DHDN_3GK4", 31468, None),
        ("EPSG:5555", 25832, 5783),
        ("EPSG:7415", 28992, 5709),
        ("EPSG:6697", 6668, 6695),
        (" EPSG:4326 ", 4326, None),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH*GCG2016", 25832, 7837),
        ("urn:adv:crs:ETRS89_UTM33*DE_DHHN2016_NH_GCG2016", 25833, 7837),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN92_NH*DE_GCG05", 25832, 5783),
        ("urn:adv:crs:ETRS89_UTM32*DE_NHN", 25832, 7837),
        ("urn:adv:crs:ETRS89_UTM32*DE_DHHN92_NHN", 25832, 5783),
        ("urn:adv:crs:ETRS89_UTM32_zE-N", 4647, None),
        ("urn:adv:crs:UTM32_zE-N*DE_DHHN2016_NH", 4647, 7837),
        ("urn:adv:crs:DE_DHDN_3GK2_NW101", 31466, None),
        ("urn:adv:crs:DE_RD-83_3GK4", 3398, None),
        ("ETRS89_UTM32*DE_DHHN2016_NH", 25832, 7837),
        ("https://epsg.io/25832", 25832, None),
        ("http://epsg.io/25832.wkt", 25832, None),
        ("https://epsg.org/crs_25832/ETRS89-UTM-zone-32N.html", 25832, None),
        ("https://spatialreference.org/ref/epsg/28992/", 28992, None),
        ("https://www.opengis.net/def/crs/EPSG/0/3068", 3068, None),
        ("http://www.opengis.net/def/crs/EPSG/9.9.1/25832/", 25832, None),
        ("urn:x-ogc:def:crs:EPSG:25832", 25832, None),
        ("urn:ogc:def:crs:EPSG:v9.9:25832", 25832, None),
        ("EPSG 25832", 25832, None),
        ("EPSG_25832", 25832, None),
        ("25832", 25832, None),
        ("EPSG:25832,EPSG:7837", 25832, 7837),
        ("EPSG:25832 + EPSG:7837", 25832, 7837),
        ("EPSG:25832+EPSG:7837", 25832, 7837),
        ("ETRS89 / UTM zone 32N + DHHN2016 height", 25832, 7837),
        ("EPSG:900913", 3857, None),
        ("ESRI:102100", 3857, None),
        ("EPSG:102100", 3857, None),
    ],
)
def test_names_have_a_horizontal_and_a_vertical_part(name: str, horizontal: int, vertical: int | None) -> None:
    crs = parse_crs(name)
    height = vertical_crs(crs)
    assert horizontal_crs(crs).to_epsg() == horizontal
    assert (None if height is None else height.to_epsg()) == vertical


@pytest.mark.parametrize("code", [25832, 2180, 28992, 31467, 3857, 2263, 27700])
@pytest.mark.parametrize("form", ["WKT1_GDAL", "WKT1_ESRI", "WKT2_2015", "WKT2_2019", "PROJJSON"])
def test_descriptions_of_projected_systems_are_those_of_their_code(code: int, form: str) -> None:
    crs = CRS.from_epsg(code)
    text = crs.to_json() if form == "PROJJSON" else crs.to_wkt(form, pretty=True)
    place = (np.array([500_000.0]), np.array([400_000.0]))
    assert np.allclose(np.array(find_transformation(parse_crs(text), crs)(*place)), np.array(place), atol=0.001)
    if form != "WKT1_GDAL":
        assert horizontal_crs(parse_crs(text)).to_epsg() == code


def test_descriptions_keep_heights_and_the_order_of_degrees() -> None:
    for text in (CRS("EPSG:25832+7837").to_wkt("WKT1_GDAL"), CRS("EPSG:25832+7837").to_wkt(), CRS("EPSG:25832+7837").to_json()):
        assert vertical_crs_name(parse_crs(text)) == "DHHN2016 height"
    for code, first in ((4326, "north"), (4258, "north")):
        assert parse_crs(CRS.from_epsg(code).to_wkt()).axis_info[0].direction == first


@pytest.mark.parametrize(
    "name", ["OGC:CRS84", "CRS:84", "urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:OGC::CRS84h", "http://www.opengis.net/def/crs/OGC/1.3/CRS84"]
)
def test_names_of_the_ogc_have_longitude_first(name: str) -> None:
    assert [axis.direction for axis in horizontal_crs(parse_crs(name)).axis_info] == ["east", "north"]


@pytest.mark.parametrize(
    "name", ["", "nonsense", "EPSG:999999", "urn:adv:crs:ETRS89_UTM99", "urn:adv:crs:ETRS89_UTM32*DE_WHAT", "EPSG:25832+nothing", "unknown"]
)
def test_unknown_names_say_what_to_do(name: str) -> None:
    with pytest.raises(CrsError, match="--crs"):
        parse_crs(name)


@pytest.mark.parametrize("name", ["EPSG:5783", "urn:ogc:def:crs:EPSG::7837"])
def test_heights_alone_are_not_a_crs_of_positions(name: str) -> None:
    with pytest.raises(CrsError, match=r"has heights alone; name the whole with --crs"):
        parse_crs(name)


def test_ellipsoidal_heights_have_a_name() -> None:
    assert vertical_crs_name(parse_crs("EPSG:4979")) == "ellipsoidal height (WGS 84)"
    assert vertical_crs_name(parse_crs("EPSG:25832")) is None
