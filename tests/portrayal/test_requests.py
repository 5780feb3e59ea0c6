"""The grammar of requests, as key-value pairs and as XML."""

from urllib.parse import quote

import pytest

from map3d.portrayal.kvp import parse_query
from map3d.portrayal.parameters import Parameters
from map3d.portrayal.requests import parse_get_view
from map3d.portrayal.service_exception import ServiceException
from map3d.portrayal.xml_requests import parse_body

TUPLE = "Perspective,202000,3310000,200,202000,3305000,200,0,0,1,60,,0.01,1000.0"
PARTS = f"WIDTH=1024;HEIGHT=768;PROJECTION={TUPLE};IMAGELAYERS=COLOR,DEPTH;FORMATS=image/jpeg,image/png%3Bmode=32bit;QUALITIES=85,"
BASE = "service=3DPS&version=1.0&request=GetView&crs=EPSG:26916&layers=a,b&"


def view(query: str) -> object:
    return parse_get_view(parse_query((BASE + query).encode()))


def whole_view(query: str) -> None:
    """Also checks what depends on the size of the image."""
    (portrayal,) = view(query).portrayals
    portrayal.projection.window(portrayal.width_px, portrayal.height_px)
    portrayal.projection.planes()


REFERENCE = view(f"PORTRAYALS={PARTS}")

SAME = {
    "names in other cases": f"pOrTrAyAlS={PARTS.replace('WIDTH', 'Width').replace('HEIGHT', 'height')}",
    "MIME types encoded as RFC 1738 says": f"portrayals={PARTS.replace('image/', 'image%2F')}",
    "the value encoded as a whole": f"portrayals={quote(PARTS, safe='')}",
    "the value encoded by URLSearchParams from plain text": f"portrayals={quote(PARTS.replace('%3B', ';'), safe='')}",
    "parts as keys, as in the example of the standard": f"PORTRAYALS=WIDTH=1024;HEIGHT=768;&Projection={TUPLE}&{PARTS[PARTS.index('IMAGELAYERS') :]}",
    "a semicolon that is not encoded": f"portrayals={PARTS.replace('%3B', ';')}",
    "blanks in the MIME type": f"portrayals={PARTS.replace('%3Bmode', '%3B%20mode')}",
    "other spellings of numbers": f"portrayals={PARTS.replace('=1024', '=01024').replace('202000', '202000.0').replace(',60,', ',6e1,')}",
    "the URI of an image layer": "portrayals="
    + PARTS.replace("COLOR", quote("http://www.opengis.net/spec/3DPS/1.0/concept/service/view/imageLayers/color", safe="")),
    "parts in another order": "portrayals=" + ";".join(reversed(PARTS.split(";"))),
}


@pytest.mark.parametrize("query", SAME.values(), ids=SAME)
def test_all_spellings_of_a_view_are_one(query: str) -> None:
    assert view(query) == REFERENCE


def test_several_portrayals_are_separated_by_at() -> None:
    found = view(f"portrayals={PARTS}@{PARTS.replace('1024', '512')}")
    assert [one.width_px for one in found.portrayals] == [1024, 512]


def test_empty_qualities_are_100() -> None:
    assert view(f"portrayals={PARTS}").portrayals[0].qualities == (85, 100)
    assert view(f"portrayals={PARTS.replace('85,', '')}").portrayals[0].qualities == (100, 100)


XML = """<?xml version="1.0" encoding="UTF-8"?>
<view:GetView xmlns:core="http://www.opengis.net/3dps/1.0/core" xmlns:view="http://www.opengis.net/3dps/1.0/view" xmlns:ows="http://www.opengis.net/ows/1.1"
  service="3DPS" request="GetView" version="1.0">
  <core:CRS>EPSG:26916</core:CRS>
  <core:Layers><ows:Identifier>a</ows:Identifier><ows:Identifier>b</ows:Identifier></core:Layers>
  <view:Portrayals><view:Portrayal>
    <view:Width>1024</view:Width><view:Height>768</view:Height>
    <view:PerspectiveProjection>
      <view:POC>202000 3310000 200</view:POC><view:POI>202000 3305000 200</view:POI><view:Up>0 0 1</view:Up>
      <view:FOVX>60</view:FOVX><view:NearPlane>0.01</view:NearPlane><view:FarPlane>1000.0</view:FarPlane>
    </view:PerspectiveProjection>
    <view:ImageLayers><ows:Identifier>COLOR</ows:Identifier><ows:Identifier>DEPTH</ows:Identifier></view:ImageLayers>
    <view:Formats><view:Format>image/jpeg</view:Format><view:Format>image/png; mode=32bit</view:Format></view:Formats>
    <view:Qualities>85,</view:Qualities>
  </view:Portrayal></view:Portrayals>
</view:GetView>"""
SCHEMA_XML = """<GetView service="3DPS" request="GetView" version="1.0">
  <CRS>EPSG:26916</CRS><Layers>a,b</Layers>
  <Portrayals><Portrayal><Width>1024</Width><Height>768</Height><ImageLayers>COLOR,DEPTH</ImageLayers>
    <Formats>image/jpeg,image/png;mode=32bit</Formats><Qualities>85,</Qualities>
    <v:PerspectiveProjection xmlns:v="http://www.opengis.net/3dps/1.0/view"><ows:Identifier xmlns:ows="http://www.opengis.net/ows/2.0">Perspective</ows:Identifier>
      <POC><X1>202000</X1><X2>3310000</X2><X3>200</X3></POC><POI><X1>202000</X1><X2>3305000</X2><X3>200</X3></POI>
      <UP><X1>0</X1><X2>0</X2><X3>1</X3></UP><FOVX>60</FOVX><NearPlane>0.01</NearPlane><FarPlane>1000</FarPlane></v:PerspectiveProjection>
  </Portrayal></Portrayals></GetView>"""


@pytest.mark.parametrize("text", [XML, SCHEMA_XML], ids=["as the text's example", "as the schemas"])
def test_xml_asks_for_the_same_view(text: str) -> None:
    assert parse_get_view(parse_body(text.encode())) == REFERENCE


BAD_XML = {
    "a document type": '<!DOCTYPE GetView><GetView service="3DPS"/>',
    "entities that grow": '<!DOCTYPE a [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><GetView>&b;</GetView>',
    "an external entity": '<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]><GetView>&a;</GetView>',
    "an external document type": '<!DOCTYPE a SYSTEM "http://127.0.0.1:1/a.dtd"><GetView/>',
    "an unknown entity": "<GetView>&nbsp;</GetView>",
    "an open element": "<GetView>",
    "no element": "",
    "deep elements": "<GetView>" + "<a>" * 100 + "</a>" * 100 + "</GetView>",
    "too much": "<GetView>" + " " * 70_000 + "</GetView>",
    "an unknown encoding": '<?xml version="1.0" encoding="x-unknown"?><GetView/>',
}


@pytest.mark.parametrize("text", BAD_XML.values(), ids=BAD_XML)
def test_xml_is_refused(text: str) -> None:
    with pytest.raises(ServiceException) as raised:
        parse_body(text.encode())
    assert raised.value.status == 400


BAD = {
    "huge width": PARTS.replace("1024", "4097"),
    "zero width": PARTS.replace("1024", "0"),
    "negative width": PARTS.replace("1024", "-1024"),
    "width with a fraction": PARTS.replace("1024", "1024.5"),
    "digits that are not ASCII": PARTS.replace("1024", quote("１０２４")),
    "digits with a separator": PARTS.replace("1024", "1_024"),
    "a very long number": PARTS.replace("1024", "9" * 5000),
    "NaN": PARTS.replace(",60,", ",NaN,"),
    "infinity": PARTS.replace(",60,", ",inf,"),
    "an overflow": PARTS.replace("202000", "1e999"),
    "a coordinate beyond 1e9": PARTS.replace("202000", "1e10"),
    "hexadecimal": PARTS.replace("202000", "0x10"),
    "a field of view of 180": PARTS.replace(",60,", ",180,"),
    "a near plane of 0": PARTS.replace("0.01", "0"),
    "far before near": PARTS.replace("1000.0", "0.001"),
    "a missing coordinate": PARTS.replace("3310000", ""),
    "half an UP": PARTS.replace("0,0,1", "0,,1"),
    "too many values": PARTS.replace("1000.0", "1000.0,1"),
    "an unknown projection": PARTS.replace("Perspective", "Fisheye"),
    "an unknown image layer": PARTS.replace("DEPTH", "HEAT"),
    "an unknown format": PARTS.replace("image/jpeg", "image/gif"),
    "a lossy depth": PARTS.replace("image/png%3Bmode=32bit", "image/jpeg"),
    "fewer formats": PARTS.replace("image/jpeg,", ""),
    "fewer qualities": PARTS.replace("85,", "85"),
    "a quality of 101": PARTS.replace("85", "101"),
    "a part twice": PARTS + ";WIDTH=5",
    "an unknown part": PARTS + ";COLOUR=red",
    "no projection": PARTS.replace(f"PROJECTION={TUPLE};", ""),
    "control characters": PARTS.replace("COLOR", "COLOR%00"),
    "bytes that are not UTF-8": PARTS.replace("COLOR", "%ff"),
    "many portrayals": "@".join([PARTS] * 17),
    "empty portrayals": "@@@",
}


@pytest.mark.parametrize("portrayals", BAD.values(), ids=BAD)
def test_portrayals_are_refused(portrayals: str) -> None:
    with pytest.raises(ServiceException) as raised:
        whole_view(f"portrayals={portrayals}")
    assert (raised.value.code, raised.value.locator) == ("InvalidParameterValue", "portrayals")


@pytest.mark.parametrize(
    ("more", "code", "locator"),
    [
        ("boundingbox=1,2,3", "InvalidParameterValue", "boundingBox"),
        ("boundingbox=5,2,1,4", "InvalidParameterValue", "boundingBox"),
        ("boundingbox=1,2,nan,4", "InvalidParameterValue", "boundingBox"),
        ("spatialselection=near", "InvalidParameterValue", "spatialSelection"),
        ("styles=x", "InvalidParameterValue", "styles"),
        ("lods=CityGML:1", "InvalidParameterValue", "lods"),
        ("lodselection=best", "InvalidParameterValue", "lodSelection"),
        ("backgroundcolor=red", "InvalidParameterValue", "backgroundColor"),
        ("backgroundcolor=0XFF0000", "InvalidParameterValue", "backgroundColor"),
        ("transparentbackground=yes", "InvalidParameterValue", "transparentBackground"),
        ("sun=10", "InvalidParameterValue", "sun"),
        ("crs=EPSG:1", "InvalidParameterValue", "crs"),
    ],
)
def test_parameters_are_refused(more: str, code: str, locator: str) -> None:
    with pytest.raises(ServiceException) as raised:
        view(f"portrayals={PARTS}&{more}")
    assert (raised.value.code, raised.value.locator) == (code, locator)


@pytest.mark.parametrize("name", ["crs", "layers"])
def test_missing_parameters_are_named(name: str) -> None:
    query = "&".join(pair for pair in BASE.split("&") if not pair.startswith(f"{name}="))
    with pytest.raises(ServiceException) as raised:
        parse_get_view(parse_query(f"{query}portrayals={PARTS}".encode()))
    assert (raised.value.code, raised.value.locator) == ("MissingParameterValue", name)


def test_portrayals_are_mandatory() -> None:
    with pytest.raises(ServiceException) as raised:
        parse_get_view(Parameters({"crs": "EPSG:1", "layers": ""}))
    assert (raised.value.code, raised.value.locator) == ("MissingParameterValue", "portrayals")
