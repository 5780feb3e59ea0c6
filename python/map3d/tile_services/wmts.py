"""WMTS 1.0.0 (OGC 07-057r7): the capabilities document and exception reports. Module `tile_address` parses the URLs of tiles."""

from collections.abc import Iterable
from typing import Final
from urllib.parse import quote
from xml.etree import ElementTree

from map3d.tile_services.tile_formats import media_types_of, suffix_of
from map3d.tile_services.tiled_view import TiledView, TileMatrix

VERSION: Final = "1.0.0"
WEB_MERCATOR_URN: Final = "urn:ogc:def:crs:EPSG::3857"
_NAMESPACE: Final = "http://www.opengis.net/wmts/1.0"
"""Namespace of elements without a prefix, because QGIS reads their names as text."""
_NAMESPACES: Final = {
    "ows": "http://www.opengis.net/ows/1.1",
    "xlink": "http://www.w3.org/1999/xlink",
}
_SCHEMA: Final = "http://www.opengis.net/wmts/1.0 http://schemas.opengis.net/wmts/1.0/wmtsGetCapabilities_response.xsd"
_XSI: Final = "{http://www.w3.org/2001/XMLSchema-instance}schemaLocation"

Element = ElementTree.Element


def capabilities(views: Iterable[TiledView], root: str) -> bytes:
    """Returns the capabilities document. `root`: absolute URL of `/wmts`.

    No authority has registered the planes of views, so that the supported CRS of their tile matrix sets is WKT, which GDAL reads.
    """
    views = tuple(views)
    document = _element("Capabilities", version=VERSION, xmlns=_NAMESPACE)
    document.set(_XSI, _SCHEMA)
    document.append(_identification())
    document.append(_operations(root))
    contents = _child(document, "Contents")
    for view in views:
        contents.append(_layer(view, root))
    by_levels = sorted(views, key=lambda view: view.manifest.zmax)
    for view in {view.tile_matrix_set: view for view in by_levels}.values():
        contents.append(_tile_matrix_set(view))
    _child(document, "ServiceMetadataURL", **{_name("xlink:href"): f"{root}/{VERSION}/WMTSCapabilities.xml"})
    return _dump(document)


def exception_report(code: str, text: str, locator: str | None = None) -> bytes:
    """Returns an OWS 1.1 exception report."""
    report = _element("ows:ExceptionReport", version="1.1.0")
    report.set("{http://www.w3.org/XML/1998/namespace}lang", "en")
    exception = _child(report, "ows:Exception", exceptionCode=code, **({} if locator is None else {"locator": locator}))
    _child(exception, "ows:ExceptionText", text)
    return _dump(report)


def _identification() -> Element:
    service = _element("ows:ServiceIdentification")
    _child(service, "ows:Title", "map3d: oblique tiles of 3D city models")
    _child(service, "ows:Abstract", "The colour layers of oblique views. A layer is one view of one rendering, a style one of its colour layers.")
    _child(service, "ows:ServiceType", "OGC WMTS")
    _child(service, "ows:ServiceTypeVersion", VERSION)
    return service


def _operations(root: str) -> Element:
    operations = _element("ows:OperationsMetadata")
    rest = {"GetCapabilities": f"{root}/{VERSION}/WMTSCapabilities.xml", "GetTile": f"{root}/{VERSION}/"}
    for name, url in rest.items():
        http = _child(_child(_child(operations, "ows:Operation", name=name), "ows:DCP"), "ows:HTTP")
        for encoding, address in (("KVP", f"{root}?"), ("RESTful", url)):
            get = _child(http, "ows:Get", **{_name("xlink:href"): address})
            _child(_child(_child(get, "ows:Constraint", name="GetEncoding"), "ows:AllowedValues"), "ows:Value", encoding)
    return operations


def _layer(view: TiledView, root: str) -> Element:
    layer = _element("Layer")
    _child(layer, "ows:Title", view.title)
    _child(layer, "ows:Abstract", view.description)
    if view.lon_lat_extent is not None:
        _corners(_child(layer, "ows:WGS84BoundingBox"), view.lon_lat_extent)
    _child(layer, "ows:Identifier", view.id)
    _corners(_child(layer, "ows:BoundingBox", crs=_supported_crs(view)), view.extent)
    for shown in view.layers:
        style = _child(layer, "Style", isDefault="true" if shown is view.layers[0] else "false")
        _child(style, "ows:Title", shown.name)
        _child(style, "ows:Identifier", shown.name)
    formats = tuple(dict.fromkeys(media_type for shown in view.layers for media_type in media_types_of(shown)))
    for media_type in formats:
        _child(layer, "Format", media_type)
    layer.append(_tile_matrix_set_link(view))
    at = f"{root}/{VERSION}/{quote(view.id, safe=':')}/{{Style}}/{{TileMatrixSet}}/{{TileMatrix}}/{{TileRow}}/{{TileCol}}"
    for media_type in formats:
        _child(layer, "ResourceURL", format=media_type, resourceType="tile", template=f"{at}.{suffix_of(media_type)}")
    return layer


def _corners(box: Element, extent: tuple[float, float, float, float]) -> None:
    left, bottom, right, top = extent
    _child(box, "ows:LowerCorner", f"{left!r} {bottom!r}")
    _child(box, "ows:UpperCorner", f"{right!r} {top!r}")


def _tile_matrix_set_link(view: TiledView) -> Element:
    linked = _element("TileMatrixSetLink")
    _child(linked, "TileMatrixSet", view.tile_matrix_set)
    limits = _child(linked, "TileMatrixSetLimits")
    for matrix in view.matrices:
        row = _child(limits, "TileMatrixLimits")
        _child(row, "TileMatrix", str(matrix.level))
        rows, columns = (matrix.min_row, matrix.max_row), (matrix.min_column, matrix.max_column)
        for key, value in zip(("MinTileRow", "MaxTileRow", "MinTileCol", "MaxTileCol"), (*rows, *columns), strict=True):
            _child(row, key, str(value))
    return linked


def _tile_matrix_set(view: TiledView) -> Element:
    defined = _element("TileMatrixSet")
    _child(defined, "ows:Title", "Google Maps Compatible for the World" if view.pseudo else f"{view.title}, plane of the view")
    _child(defined, "ows:Identifier", view.tile_matrix_set)
    _child(defined, "ows:SupportedCRS", _supported_crs(view))
    if view.pseudo:
        _child(defined, "WellKnownScaleSet", "urn:ogc:def:wkss:OGC:1.0:GoogleMapsCompatible")
    for matrix in view.matrices:
        defined.append(_tile_matrix(matrix))
    return defined


def _supported_crs(view: TiledView) -> str:
    return WEB_MERCATOR_URN if view.pseudo else view.crs().to_wkt()


def _tile_matrix(matrix: TileMatrix) -> Element:
    row = _element("TileMatrix")
    _child(row, "ows:Identifier", str(matrix.level))
    _child(row, "ScaleDenominator", repr(matrix.scale_denominator))
    _child(row, "TopLeftCorner", f"{matrix.origin[0]!r} {matrix.origin[1]!r}")
    for key, value in (("TileWidth", matrix.tile_px), ("TileHeight", matrix.tile_px), ("MatrixWidth", matrix.count), ("MatrixHeight", matrix.count)):
        _child(row, key, str(value))
    return row


def _name(name: str) -> str:
    prefix, _, local = name.rpartition(":")
    return f"{{{_NAMESPACES[prefix]}}}{local}" if prefix else local


def _element(tag: str, /, **attributes: str) -> Element:
    return Element(_name(tag), attributes)


def _child(parent: Element, tag: str, text: str | None = None, /, **attributes: str) -> Element:
    child = ElementTree.SubElement(parent, _name(tag), attributes)
    child.text = text
    return child


def _dump(document: Element) -> bytes:
    for prefix, uri in _NAMESPACES.items():
        ElementTree.register_namespace(prefix, uri)
    ElementTree.indent(document)
    return bytes(ElementTree.tostring(document, "UTF-8", xml_declaration=True))
