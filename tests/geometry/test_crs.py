"""Parsing of CRS names."""

import pytest

from map3d.errors import CrsError
from map3d.geometry.crs import horizontal_crs, parse_crs, vertical_crs, vertical_crs_name


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
    ],
)
def test_names_have_a_horizontal_and_a_vertical_part(name: str, horizontal: int, vertical: int | None) -> None:
    crs = parse_crs(name)
    height = vertical_crs(crs)
    assert horizontal_crs(crs).to_epsg() == horizontal
    assert (None if height is None else height.to_epsg()) == vertical


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
