"""The OperationsMetadata of the capabilities: every operation with every parameter of the standard's tables."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from map3d.portrayal.contents import LOD_SCHEME, Contents
from map3d.portrayal.exception_report import INFO_FORMS, VIEW_FORMS
from map3d.portrayal.requests import INFO_FORMATS, LOD_SELECTIONS, SERVICE, SPATIAL_SELECTIONS, VERSIONS
from map3d.portrayal.styles import DEFAULT_STYLE, STYLES
from map3d.portrayal.views import BACKGROUNDS
from map3d.portrayal.xml_writer import XmlWriter


@dataclass(frozen=True)
class Parameter:
    """`values`: None for any value."""

    name: str
    values: Sequence[str] | None = None
    default: str | None = None


INFO_OPERATIONS: Final = ("GetFeatureInfoByRay", "GetFeatureInfoByPosition", "GetFeatureInfoByObjectId")
RESOURCE_FORMATS: Final = ("image/webp", "image/png", "image/jpeg", "application/json")
_VIEW_FORMS: Final = (*VIEW_FORMS, "application/vnd.ogc.se_xml", "application/vnd.ogc.se_inimage", "application/vnd.ogc.se_blank")


def write_operations(xml: XmlWriter, endpoint: str, contents: Contents) -> None:
    with xml.element("ows:OperationsMetadata"):
        for name, parameters in _operations(contents):
            with xml.element("ows:Operation", {"name": name}):
                _write_dcp(xml, endpoint)
                for parameter in parameters:
                    _write_parameter(xml, parameter)


def _write_dcp(xml: XmlWriter, endpoint: str) -> None:
    with xml.element("ows:DCP"), xml.element("ows:HTTP"):
        xml.leaf("ows:Get", "", {"xlink:href": f"{endpoint}?"})
        xml.leaf("ows:Post", "", {"xlink:href": endpoint})


def _write_parameter(xml: XmlWriter, parameter: Parameter) -> None:
    with xml.element("ows:Parameter", {"name": parameter.name}):
        if parameter.values:
            with xml.element("ows:AllowedValues"):
                for value in parameter.values:
                    xml.leaf("ows:Value", value)
        else:
            xml.leaf("ows:AnyValue")
        if parameter.default is not None:
            xml.leaf("ows:DefaultValue", parameter.default)


def _operations(contents: Contents) -> list[tuple[str, list[Parameter]]]:
    layers = _layer_names(contents)
    systems = list(dict.fromkeys(name for scene in contents.scenes for name in scene.systems.available))
    return [
        (
            "GetCapabilities",
            [
                Parameter("service", (SERVICE,)),
                Parameter("request", ("GetCapabilities",)),
                Parameter("acceptVersions", VERSIONS),
                Parameter("sections"),
                Parameter("updateSequence"),
                Parameter("acceptFormats", ("text/xml",), "text/xml"),
            ],
        ),
        ("GetView", [*_common("GetView"), *_view_parameters(contents, layers, systems)]),
        *((name, [*_common(name), *_info_parameters(name, layers, systems)]) for name in INFO_OPERATIONS),
        ("GetResourceById", [*_common("GetResourceById"), Parameter("ResourceId"), Parameter("OutputFormat", RESOURCE_FORMATS)]),
    ]


def _common(name: str) -> list[Parameter]:
    return [Parameter("service", (SERVICE,)), Parameter("request", (name,)), Parameter("version", VERSIONS[:1])]


def _view_parameters(contents: Contents, layers: Sequence[str], systems: Sequence[str]) -> list[Parameter]:
    lods = [f"{LOD_SCHEME}:{lod}" for lod in sorted({lod for scene in contents.scenes for lod in scene.lods})]
    return [
        Parameter("CRS", systems),
        Parameter("BoundingBox"),
        Parameter("SpatialSelection", SPATIAL_SELECTIONS, SPATIAL_SELECTIONS[0]),
        Parameter("Layers", layers),
        Parameter("Styles", tuple(STYLES), DEFAULT_STYLE),
        Parameter("Background", tuple(BACKGROUNDS)),
        Parameter("LODs", lods),
        Parameter("LODSelection", LOD_SELECTIONS, LOD_SELECTIONS[0]),
        Parameter("OverallStyles"),
        Parameter("DeliveryOptions"),
        Parameter("Exceptions", _VIEW_FORMS, VIEW_FORMS[0]),
        Parameter("BackgroundColor", None, "0xFFFFFF"),
        Parameter("TransparentBackground", ("true", "false"), "false"),
        Parameter("Portrayals"),
        Parameter("Sun", None, "210,45"),
    ]


def _info_parameters(name: str, layers: Sequence[str], systems: Sequence[str]) -> list[Parameter]:
    own = {
        "GetFeatureInfoByRay": [
            Parameter("CRS", systems),
            Parameter("Width"),
            Parameter("Height"),
            Parameter("Projection"),
            Parameter("ImagePosition"),
        ],
        "GetFeatureInfoByPosition": [Parameter("CRS", systems), Parameter("Coordinate"), Parameter("Tolerance", None, "1")],
        "GetFeatureInfoByObjectId": [Parameter("ObjectId")],
    }
    return [
        Parameter("Layers", layers),
        Parameter("FeatureCount", None, "1"),
        Parameter("IdOnly", ("true", "false"), "false"),
        Parameter("Format", INFO_FORMATS),
        Parameter("Exceptions", INFO_FORMS, INFO_FORMS[0]),
        *own[name],
    ]


def _layer_names(contents: Contents) -> list[str]:
    return [name for scene in contents.scenes for name in (scene.identifier, *(asset.identifier for asset in scene.assets))]
