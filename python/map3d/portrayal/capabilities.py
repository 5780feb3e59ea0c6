"""GetCapabilities: what the service offers, in the letter of the text or valid against the published schemas (docs/portrayal-service.md).

The published schemas contradict the text: they leave out the Extensions element, qualify no local element, and demand three numbers in versions. The
text's flavour is the default; the strict one validates with the derived types of `STRICT_NAMESPACE`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlencode

import numpy as np

from map3d.geometry.frames import corners
from map3d.portrayal.capabilities_operations import write_operations
from map3d.portrayal.contents import LOD_SCHEME, AssetLayer, Contents, SceneLayer
from map3d.portrayal.image_formats import IMAGE_LAYERS
from map3d.portrayal.parameters import Parameters
from map3d.portrayal.projections import FOVX_DEG, NEAR_M, PROJECTIONS
from map3d.portrayal.request_crs import CRS84, SceneSystems
from map3d.portrayal.requests import LOD_SELECTIONS, SPATIAL_SELECTIONS, VERSIONS
from map3d.portrayal.resources import JSON
from map3d.portrayal.scalars import parse_list
from map3d.portrayal.service_exception import ServiceException, invalid, quote
from map3d.portrayal.styles import DEFAULT_STYLE, STYLES
from map3d.portrayal.views import BACKGROUNDS
from map3d.portrayal.xml_writer import XmlWriter
from map3d.tiles.manifest import FILE_NAME
from map3d.types import Box

NAMESPACES: Final = {
    "core": "http://www.opengis.net/3dps/1.0/core",
    "view": "http://www.opengis.net/3dps/1.0/view",
    "info": "http://www.opengis.net/3dps/1.0/info",
    "ows": "http://www.opengis.net/ows/2.0",
    "xlink": "http://www.w3.org/1999/xlink",
    "xsi": "http://www.w3.org/2001/XMLSchema-instance",
}
STRICT_NAMESPACE: Final = "urn:example:3dps-ext"
RENDERING_ROLE: Final = "urn:map3d:def:rendering"
"""Role of the metadata of a layer that are the manifest of a rendering."""
PROFILES: Final = tuple(f"http://www.opengis.net/spec/3DPS/1.0/extension/{name}/1.0" for name in ("view", "info"))
SECTIONS: Final = ("ServiceIdentification", "ServiceProvider", "OperationsMetadata", "Languages", "Contents", "PortrayalCapabilities")
ALL: Final = "All"
FAR_HINT_M: Final = 20_000.0
LARGEST_HINTS: Final = 50
"""Scenes with viewpoint hints, so that the document stays small."""


@dataclass(frozen=True)
class Flavour:
    """`strict`: valid against the published schemas."""

    strict: bool

    @property
    def version(self) -> str:
        return VERSIONS[1] if self.strict else VERSIONS[0]

    def name(self, prefix: str, local: str, strict_local: str | None = None) -> str:
        """Returns the name of an element that the schemas leave unqualified."""
        return (strict_local or local) if self.strict else f"{prefix}:{local}"


@dataclass(frozen=True)
class CapabilitiesRequest:
    """`sections`: names of those to return; `update_sequence`: of the client's document, or None."""

    sections: frozenset[str]
    update_sequence: int | None


def parse_get_capabilities(parameters: Parameters) -> CapabilitiesRequest:
    """Raises VersionNegotiationFailed, InvalidParameterValue."""
    versions = parse_list(parameters.get("acceptVersions") or "")
    if versions and not set(versions) & set(VERSIONS):
        text = f"acceptVersions: this service has version {VERSIONS[0]}, got {quote(','.join(versions))}"
        raise ServiceException("VersionNegotiationFailed", text, "acceptVersions")
    sections = [section for section in parse_list(parameters.get("sections") or "") if section]
    known = {name.lower(): name for name in (*SECTIONS, ALL)}
    for section in sections:
        if section.lower() not in known:
            raise invalid("sections", f"{quote(section)}, expected {', '.join((*SECTIONS, ALL))}")
    chosen = frozenset(known[section.lower()] for section in sections)
    sequence = parameters.non_empty("updateSequence")
    if sequence is not None and not (sequence.isascii() and sequence.isdigit() and len(sequence) <= 18):
        raise ServiceException("InvalidUpdateSequence", f"updateSequence {quote(sequence)}: expected a number", "updateSequence")
    return CapabilitiesRequest(frozenset(SECTIONS) if not chosen or ALL in chosen else chosen, None if sequence is None else int(sequence))


@dataclass(frozen=True)
class ServiceContents:
    """What a document describes. `renderings`: names by scene; `sequence`: of both; `endpoint`: the service's URL."""

    contents: Contents
    renderings: Mapping[str, Sequence[str]]
    sequence: int
    endpoint: str


def capabilities(request: CapabilitiesRequest, service: ServiceContents, flavour: Flavour) -> bytes:
    """Returns the document. Raises InvalidUpdateSequence."""
    contents, sequence, endpoint = service.contents, service.sequence, service.endpoint
    if request.update_sequence is not None and request.update_sequence > sequence:
        text = f"updateSequence {request.update_sequence} is greater than the present one, {sequence}"
        raise ServiceException("InvalidUpdateSequence", text, "updateSequence")
    sections = frozenset[str]() if request.update_sequence == sequence else request.sections
    xml = XmlWriter()
    namespaces = {f"xmlns:{prefix}": uri for prefix, uri in NAMESPACES.items()} | ({"xmlns:x": STRICT_NAMESPACE} if flavour.strict else {})
    with xml.element("core:Capabilities", {**namespaces, "version": flavour.version, "updateSequence": str(sequence)}):
        if "ServiceIdentification" in sections:
            _write_identification(xml, flavour)
        if "ServiceProvider" in sections:
            with xml.element("ows:ServiceProvider"):
                xml.leaf("ows:ProviderName", "map3d")
                xml.leaf("ows:ServiceContact")
        if "OperationsMetadata" in sections:
            write_operations(xml, endpoint, contents)
        if "Languages" in sections:
            with xml.element("ows:Languages"):
                xml.leaf("ows:Language", "en")
        if "Contents" in sections:
            with xml.element(flavour.name("core", "Contents")):
                for scene in contents.scenes:
                    _write_scene(xml, scene, service, flavour)
        if "PortrayalCapabilities" in sections:
            _write_portrayal_capabilities(xml, contents, flavour)
    return xml.document()


def _write_identification(xml: XmlWriter, flavour: Flavour) -> None:
    with xml.element("ows:ServiceIdentification"):
        xml.leaf("ows:Title", "3D city models")
        xml.leaf("ows:Abstract", "Views of 3D city models from any position in any direction, and information about their objects")
        with xml.element("ows:Keywords"):
            for keyword in ("3D", "portrayal", "city model"):
                xml.leaf("ows:Keyword", keyword)
        xml.leaf("ows:ServiceType", "3DPS", {"codeSpace": "OGC"})
        xml.leaf("ows:ServiceTypeVersion", flavour.version)
        for profile in PROFILES:
            xml.leaf("ows:Profile", profile)
        xml.leaf("ows:Fees", "none")
        xml.leaf("ows:AccessConstraints", "none")


def _write_scene(xml: XmlWriter, scene: SceneLayer, service: ServiceContents, flavour: Flavour) -> None:
    with xml.element(flavour.name("core", "Layer"), _layer_type(flavour)):
        _write_layer_head(xml, scene.title, scene.record.attribution, scene.identifier, scene.systems, scene.lods, flavour)
        for asset in scene.assets:
            _write_asset(xml, asset, scene, flavour)
        links = {name: _manifest_url(service.endpoint, name) for name in service.renderings.get(scene.identifier, ())}
        _write_layer_tail(xml, scene.box, scene.systems, flavour, links)


def _write_asset(xml: XmlWriter, asset: AssetLayer, scene: SceneLayer, flavour: Flavour) -> None:
    with xml.element(flavour.name("core", "Layer"), _layer_type(flavour)):
        abstract = f"{asset.summary.count} objects"
        _write_layer_head(xml, asset.title, abstract, asset.identifier, scene.systems, asset.summary.lods, flavour)
        _write_layer_tail(xml, asset.summary.box, scene.systems, flavour)


def _layer_type(flavour: Flavour) -> Mapping[str, str] | None:
    return {"xsi:type": "x:LayerType"} if flavour.strict else None


def _write_layer_head(
    xml: XmlWriter, title: str, abstract: str, identifier: str, systems: SceneSystems, lods: Iterable[str], flavour: Flavour
) -> None:
    xml.leaf("ows:Title", title)
    if abstract:
        xml.leaf("ows:Abstract", abstract)
    xml.leaf("ows:Identifier", identifier)
    for name in systems.advertised:
        xml.leaf(flavour.name("core", "AvailableCRS"), name)
    for lod in lods:
        xml.leaf(flavour.name("core", "AvailableLOD"), f"{LOD_SCHEME}:{lod}")


def _manifest_url(endpoint: str, rendering: str) -> str:
    """Returns the GetResourceById request for the manifest of a rendering, which tells clients the pixel grid of its tiles."""
    query = {"service": "3DPS", "version": VERSIONS[0], "request": "GetResourceById"}
    return f"{endpoint}?{urlencode(query | {'resourceId': f'tiles/{rendering}/{FILE_NAME}', 'outputFormat': JSON}, safe='/')}"


def _write_layer_tail(xml: XmlWriter, box: Box | None, systems: SceneSystems, flavour: Flavour, links: Mapping[str, str] | None = None) -> None:
    """Writes what follows the layers below. `links`: URLs of the manifests of renderings by name."""
    for style in STYLES.values():
        with xml.element(flavour.name("core", "AvailableStyle")):
            xml.leaf("ows:Title", style.title)
            xml.leaf("ows:Abstract", style.abstract)
            xml.leaf("ows:Identifier", style.name)
            if not flavour.strict:
                xml.leaf("core:IsDefault", "true" if style.name == DEFAULT_STYLE else "false")
    if box is not None:
        _write_lon_lat_box(xml, box, systems, flavour)
    for name, link in (links or {}).items():
        xml.leaf(flavour.name("ows", "Metadata"), "", {"xlink:type": "simple", "xlink:href": link, "xlink:role": RENDERING_ROLE, "xlink:title": name})
    if box is not None:
        _write_own_box(xml, box, systems, flavour)
    with xml.element(flavour.name("core", "Extensions")):
        xml.leaf(flavour.name("info", "InfoLayerExtension"), "", {"queryable": "true"})


def _write_lon_lat_box(xml: XmlWriter, box: Box, systems: SceneSystems, flavour: Flavour) -> None:
    lon_lat = systems.available.get(CRS84)
    if lon_lat is not None:
        places = np.array([lon_lat.from_local((x, y, z)) for x, y, z in corners(box).tolist()])
        with xml.element(flavour.name("ows", "WGS84BoundingBox")):
            xml.leaf("ows:LowerCorner", _numbers(places[:, :2].min(axis=0), 7))
            xml.leaf("ows:UpperCorner", _numbers(places[:, :2].max(axis=0), 7))


def _write_own_box(xml: XmlWriter, box: Box, systems: SceneSystems, flavour: Flavour) -> None:
    own = systems.available[systems.primary]
    places = np.array([own.from_local((x, y, z)) for x, y, z in corners(box).tolist()])
    with xml.element(flavour.name("ows", "BoundingBox"), {"crs": systems.primary, "dimensions": "3"}):
        xml.leaf("ows:LowerCorner", _numbers(places.min(axis=0), 3))
        xml.leaf("ows:UpperCorner", _numbers(places.max(axis=0), 3))


def _write_portrayal_capabilities(xml: XmlWriter, contents: Contents, flavour: Flavour) -> None:
    attributes = {"xsi:type": "x:PortrayalCapabilitiesType"} if flavour.strict else None
    with xml.element(flavour.name("core", "PortrayalCapabilities"), attributes):
        for method in SPATIAL_SELECTIONS:
            xml.leaf(flavour.name("core", "AvailableSpatialSelection"), method)
        lods = sorted({lod for scene in contents.scenes for lod in scene.lods})
        for method in LOD_SELECTIONS if lods else ():
            xml.leaf(flavour.name("core", "AvailableLODSelection"), method)
        xml.leaf(flavour.name("core", "SupportsBoundingBoxConversion"), "true")
        if lods and not flavour.strict:  # the schema's type of a level, QName, holds no level
            with xml.element("core:AvailableLODScheme"):
                xml.leaf("ows:Title", LOD_SCHEME)
                xml.leaf("ows:Identifier", LOD_SCHEME, {"codeSpace": "http://www.opengis.net/3dps/1.0"})
                for lod in lods:
                    xml.leaf("core:LOD", f"{LOD_SCHEME}:{lod}")
        for scene in contents.scenes[:LARGEST_HINTS]:
            _write_viewpoint(xml, scene, flavour)
        for name in BACKGROUNDS:
            with xml.element(flavour.name("core", "Background")):
                xml.leaf("ows:Title", name.capitalize())
                xml.leaf("ows:Identifier", name)
        with xml.element(flavour.name("core", "Extensions")):
            _write_view_extension(xml, flavour)


def _write_viewpoint(xml: XmlWriter, scene: SceneLayer, flavour: Flavour) -> None:
    """Writes a view of the whole scene from the south, 45° from above, in the scene's own coordinate system."""
    if scene.box is None:
        return
    low, high = np.array(scene.box[0]), np.array(scene.box[1])
    centre, reach = (low + high) / 2, float(np.linalg.norm(high - low))
    camera = centre + np.array([0.0, -1.0, 1.0]) * max(reach, 1.0) * 0.75
    own = scene.systems.available[scene.systems.primary]
    points = [own.from_local((float(p[0]), float(p[1]), float(p[2]))) for p in (camera, centre)]
    with xml.element(flavour.name("core", "ViewpointHint")):
        xml.leaf("ows:Title", scene.title)
        xml.leaf("ows:Abstract", f"All of layer {scene.identifier} from the south, in {scene.systems.primary}")
        for name, point in (("POC", points[0]), ("POI", points[1]), ("UP", (0.0, 0.0, 1.0))):
            with xml.element(flavour.name("core", name)):
                for axis, value in zip(("X1", "X2", "X3"), point, strict=True):
                    xml.leaf(flavour.name("core", axis), _numbers([value], 3))
        xml.leaf(flavour.name("core", "FOVX"), f"{FOVX_DEG:g}")


def _write_view_extension(xml: XmlWriter, flavour: Flavour) -> None:
    with xml.element(flavour.name("view", "ViewPortrayalCapabilitiesExtension")):
        xml.leaf(flavour.name("view", "FarPlaneHint", "farPlaneHint"), f"{FAR_HINT_M:g}")
        xml.leaf(flavour.name("view", "NearPlaneHint", "nearPlaneHint"), f"{NEAR_M['Perspective']:g}")
        xml.leaf(flavour.name("view", "SupportsMultipleViews", "supportsMultipleViews"), "true")
        for layer in IMAGE_LAYERS.values():
            with xml.element(flavour.name("view", "AvailableImageLayer")):
                xml.leaf("ows:Title", layer.title)
                xml.leaf("ows:Abstract", layer.abstract)
                xml.leaf(flavour.name("ows", "Identifier"), layer.name)
                for image_format in layer.formats:
                    xml.leaf(flavour.name("view", "AvailableFormat"), image_format)
        for projection in PROJECTIONS.values():
            with xml.element(flavour.name("view", "AvailableProjection")):
                xml.leaf("ows:Title", projection.title)
                xml.leaf("ows:Identifier", projection.name)
                if not flavour.strict:
                    xml.leaf("view:TypeName", projection.name)
                for parameter in projection.parameters:
                    attributes = {"name": parameter.name, "required": "true" if parameter.required else "false"}
                    with xml.element(flavour.name("view", "ProjectionParameter"), attributes):
                        xml.leaf("ows:AnyValue")
                        if parameter.default is not None:
                            xml.leaf("ows:DefaultValue", parameter.default)
                        xml.leaf("ows:Meaning", f"{parameter.meaning} [{parameter.unit}]")


def _numbers(values: Iterable[float], digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)
