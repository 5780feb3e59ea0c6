"""The abstract test suite of OGC 15-001r4 Annex A, executed against the service as its clients see it."""

import io
import itertools
import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from lxml import etree
from PIL import Image

from map3d.catalogue import Workspace
from map3d.portrayal.service import PortrayalService
from map3d.portrayal.tracer_pool import TracerPool
from tests.portrayal.conftest import Ask
from tests.portrayal.queries import PERSPECTIVE, get_view

NAMES = {
    "ows": "http://www.opengis.net/ows/2.0",
    "core": "http://www.opengis.net/3dps/1.0/core",
    "view": "http://www.opengis.net/3dps/1.0/view",
    "info": "http://www.opengis.net/3dps/1.0/info",
    "xlink": "http://www.w3.org/1999/xlink",
}
EXTENSION = "http://www.opengis.net/spec/3DPS/1.0/extension"
TABLE_24 = [
    "service",
    "request",
    "version",
    "CRS",
    "BoundingBox",
    "SpatialSelection",
    "Layers",
    "Styles",
    "Background",
    "LODs",
    "LODSelection",
    "OverallStyles",
    "DeliveryOptions",
    "Exceptions",
]
TABLE_45 = ["BackgroundColor", "TransparentBackground", "Portrayals"]
TABLE_50 = ["Layers", "FeatureCount", "IdOnly", "Format", "Exceptions"]
OWN = {
    "GetFeatureInfoByRay": ["CRS", "Width", "Height", "Projection", "ImagePosition"],
    "GetFeatureInfoByPosition": ["CRS", "Coordinate", "Tolerance"],
    "GetFeatureInfoByObjectId": ["ObjectId"],
}
STANDARDS = Path(os.environ.get("MAP3D_STANDARDS", Path(__file__).parents[2].parent / "shared" / "standards"))


@pytest.fixture
def service(workspace: Workspace) -> Iterator[PortrayalService]:
    """The service with the real tracer."""
    made = PortrayalService(workspace, pool=TracerPool(subprocesses=1), limit_bytes=1 << 30)
    yield made
    made.close()


@pytest.fixture
def capabilities(ask: Ask) -> etree._Element:
    answer = ask("service=3DPS&request=GetCapabilities&acceptVersions=1.0", raw=True)
    assert (answer.status, answer.media_type) == (200, "text/xml")
    return etree.fromstring(answer.body)


def operation(capabilities: etree._Element, name: str) -> dict[str, list[str]]:
    """Returns the declared values of each parameter of an operation."""
    (found,) = capabilities.xpath(f"ows:OperationsMetadata/ows:Operation[@name='{name}']", namespaces=NAMES)
    return {
        parameter.get("name"): parameter.xpath("ows:AllowedValues/ows:Value/text()", namespaces=NAMES)
        for parameter in found.xpath("ows:Parameter", namespaces=NAMES)
    }


def texts(capabilities: etree._Element, path: str) -> list[str]:
    return capabilities.xpath(path, namespaces=NAMES)


# -- A1: core ---------------------------------------------------------------------------------------------------------------------------


def test_root_is_a_capabilities_document(capabilities: etree._Element) -> None:
    assert capabilities.tag == f"{{{NAMES['core']}}}Capabilities"
    assert (capabilities.get("version"), capabilities.get("updateSequence")) == ("1.0", "1")
    sections = [etree.QName(child).localname for child in capabilities]
    assert sections == ["ServiceIdentification", "ServiceProvider", "OperationsMetadata", "Languages", "Contents", "PortrayalCapabilities"]


def test_strict_flavour_is_valid_against_the_published_schemas(ask: Ask) -> None:
    path = STANDARDS / "3dps-probe" / "ext.xsd"
    if not path.is_file():
        pytest.skip(f"the strict flavour is not validated: no schemas at {STANDARDS}; name their folder in MAP3D_STANDARDS")
    schema = etree.XMLSchema(etree.parse(path))
    for query in ("", "&sections=Contents", "&sections=ServiceIdentification,PortrayalCapabilities", "&updateSequence=1"):
        answer = ask(f"service=3DPS&request=GetCapabilities{query}", raw=True, strict=True)
        document = etree.fromstring(answer.body)
        assert schema.validate(document), schema.error_log
        assert document.get("version") == "1.0.0"


@pytest.mark.parametrize(
    ("sections", "expected"),
    [
        ("Contents", ["Contents"]),
        ("contents,PortrayalCapabilities", ["Contents", "PortrayalCapabilities"]),
        ("All", None),
        ("All,Contents", None),
        ("", None),
    ],
)
def test_sections(ask: Ask, sections: str, expected: list[str] | None) -> None:
    root = etree.fromstring(ask(f"service=3DPS&request=GetCapabilities&sections={sections}", raw=True).body)
    assert len(root) == 6 if expected is None else [etree.QName(child).localname for child in root] == expected


def test_update_sequence(ask: Ask) -> None:
    older, same = (etree.fromstring(ask(f"service=3DPS&request=GetCapabilities&updateSequence={n}", raw=True).body) for n in (0, 1))
    assert (len(older), len(same)) == (6, 0)


def test_capabilities_by_post(ask: Ask, capabilities: etree._Element) -> None:
    answer = ask("", b'<GetCapabilities xmlns="http://www.opengis.net/3dps/1.0/core" service="3DPS"/>', raw=True)
    assert etree.tostring(etree.fromstring(answer.body)) == etree.tostring(capabilities)


# -- A2, A3, A4: view -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["view", "info"])
def test_profiles_are_declared(capabilities: etree._Element, name: str) -> None:
    assert f"{EXTENSION}/{name}/1.0" in texts(capabilities, "ows:ServiceIdentification/ows:Profile/text()")


def test_get_view_declares_its_parameters(capabilities: etree._Element) -> None:
    assert set(TABLE_24 + TABLE_45) <= set(operation(capabilities, "GetView"))
    assert texts(capabilities, "//ows:Operation[@name='GetView']//ows:Get/@xlink:href") == ["http://example.org/3dps?"]
    assert texts(capabilities, "//ows:Operation[@name='GetView']//ows:Post/@xlink:href") == ["http://example.org/3dps"]


def test_view_extension_declares_image_layers_and_projections(capabilities: etree._Element) -> None:
    extension = "core:PortrayalCapabilities/core:Extensions/view:ViewPortrayalCapabilitiesExtension"
    assert len(texts(capabilities, extension)) == 1
    names = texts(capabilities, f"{extension}/view:AvailableImageLayer/ows:Identifier/text()")
    assert names == ["COLOR", "DEPTH", "OBJECTID", "NORMAL", "MASK", "AO", "SUN"]
    assert texts(capabilities, f"{extension}/view:AvailableProjection/ows:Identifier/text()") == ["Perspective", "Orthographic"]
    for name, own in (("Perspective", ["FOVX", "FOVY"]), ("Orthographic", ["Left", "Right", "Bottom", "Top"])):
        path = f"{extension}/view:AvailableProjection[ows:Identifier='{name}']/view:ProjectionParameter"
        positions = [f"{group}.{axis}" for group in ("POC", "POI", "UP") for axis in ("X1", "X2", "X3")]
        assert texts(capabilities, f"{path}/@name") == [*positions, *own, "NearPlane", "FarPlane"]
        for parameter in [*own, "NearPlane", "FarPlane"]:
            assert texts(capabilities, f"{path}[@name='{parameter}']/ows:DefaultValue/text()"), f"{parameter} has a default value"


# -- A5: responses ----------------------------------------------------------------------------------------------------------------------


def test_all_layers_in_all_formats(ask: Ask, capabilities: etree._Element) -> None:
    """Requests every layer in every image layer and format singly; every answer is an image of its type."""
    layers = texts(capabilities, "//core:Layer/ows:Identifier/text()")
    formats = [
        (layer.findtext("ows:Identifier", namespaces=NAMES), found.text)
        for layer in texts(capabilities, "//view:AvailableImageLayer")
        for found in layer.findall("view:AvailableFormat", NAMES)
    ]
    assert (len(layers), len(formats)) == (5, 28)
    for layer, (image_layer, text) in itertools.product(layers, formats):
        crs = "EPSG:31467" if layer.startswith("harbour") else "EPSG:25832"
        projection = PERSPECTIVE if crs == "EPSG:25832" else "Perspective,5400000,3500000,50,5400020,3500010,0,0,0,1,60,,,"
        encoded = text.replace(";", "%3B")
        answer = ask(get_view(width=16, height=12, projection=projection, layers=image_layer, formats=encoded, scene=layer, crs=crs))
        assert (answer.status, answer.media_type) == (200, text), (layer, image_layer, text, answer.body[:500])
        image = Image.open(io.BytesIO(answer.body))
        image.load()
        assert (image.get_format_mimetype(), image.size) == (text.partition(";")[0], (16, 12))
        bits = {"mode=1bit": ["1"], "mode=24bit": ["RGB"], "mode=32bit": ["RGBA"]}
        for mode, expected in bits.items():
            assert mode not in text or image.mode in expected, (image_layer, text, image.mode)


# -- A6, A7, A8: info -------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", OWN)
def test_info_operations_declare_their_parameters(capabilities: etree._Element, name: str) -> None:
    declared = operation(capabilities, name)
    assert set(TABLE_50 + OWN[name]) <= set(declared)
    assert declared["Format"] == ["text/xml", "application/json", "text/html"]


def test_layers_have_at_most_one_info_extension(capabilities: etree._Element) -> None:
    counts = [len(layer.findall("core:Extensions/info:InfoLayerExtension", NAMES)) for layer in texts(capabilities, "//core:Layer")]
    assert counts == [1] * 5
    assert set(texts(capabilities, "//info:InfoLayerExtension/@queryable")) == {"true"}


def test_information_of_all_layers_in_all_formats(ask: Ask, capabilities: etree._Element) -> None:
    for layer in texts(capabilities, "//core:Layer[info:*|core:Extensions/info:InfoLayerExtension]/ows:Identifier/text()"):
        for text in operation(capabilities, "GetFeatureInfoByRay")["Format"]:
            crs = "EPSG:31467" if layer.startswith("harbour") else "EPSG:25832"
            projection = PERSPECTIVE if crs == "EPSG:25832" else "Perspective,5400000,3500000,50,5400020,3500010,0,0,0,1,60,,,"
            answer = ask(
                f"request=GetFeatureInfoByRay&layers={layer}&format={text}&crs={crs}&width=100&height=100&projection={projection}&imagePosition=10,10"
            )
            assert (answer.status, answer.media_type) == (200, text)
            if text == "application/json":
                json.loads(answer.body)
            else:
                etree.fromstring(answer.body, etree.XMLParser() if text == "text/xml" else etree.HTMLParser())


# -- what the layers really have --------------------------------------------------------------------------------------------------------


def test_layers_are_scenes_with_their_assets(capabilities: etree._Element) -> None:
    assert texts(capabilities, "core:Contents/core:Layer/ows:Identifier/text()") == ["harbour", "village"]
    assert texts(capabilities, "core:Contents/core:Layer/ows:Title/text()") == ["harbour", "Village & <Church>"]
    assert texts(capabilities, "core:Contents/core:Layer/core:Layer/ows:Identifier/text()") == ["harbour/boxes", "village/high", "village/low"]


def test_layers_advertise_the_levels_that_they_have(capabilities: etree._Element) -> None:
    def levels(name: str) -> list[str]:
        return texts(capabilities, f"//core:Layer[ows:Identifier='{name}']/core:AvailableLOD/text()")

    assert levels("village") == ["CityGML:1", "CityGML:2"]
    assert (levels("village/low"), levels("village/high"), levels("harbour")) == (["CityGML:1"], ["CityGML:2"], [])
    assert texts(capabilities, "//core:AvailableLODScheme/core:LOD/text()") == ["CityGML:1", "CityGML:2"]


def test_layers_advertise_systems_and_the_vertical_datum(capabilities: etree._Element) -> None:
    def systems(name: str) -> list[str]:
        return texts(capabilities, f"//core:Layer[ows:Identifier='{name}']/core:AvailableCRS/text()")

    assert systems("village") == ["EPSG:25832", "EPSG:25832+7837", "EPSG:4326", "CRS:84", "EPSG:7837"]
    assert systems("harbour") == ["EPSG:31467", "EPSG:4326", "CRS:84"]


def test_boxes_follow_the_axes_of_their_system(capabilities: etree._Element) -> None:
    def corner(name: str, box: str, corner: str) -> list[float]:
        (text,) = texts(capabilities, f"//core:Layer[ows:Identifier='{name}']/ows:{box}/ows:{corner}/text()")
        return [float(number) for number in text.split()]

    assert corner("village/low", "BoundingBox", "LowerCorner") == [691000, 5336000, 0]
    assert corner("village/low", "BoundingBox", "UpperCorner") == [691120, 5336020, 12]
    assert corner("harbour", "BoundingBox", "LowerCorner") == [5400020, 3500010, 0]
    lon, lat = corner("village", "WGS84BoundingBox", "LowerCorner")
    assert 11 < lon < 12
    assert 48 < lat < 49
