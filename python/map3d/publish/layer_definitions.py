"""Layer definitions for GIS software: the CRS of a view's plane (WKT2), a tiled source for GDAL (GDAL_WMS), and a layer for QGIS (QLR).

All three are text files that name the tiles by a URL template, so that they are small and may be copied alone.
"""

from typing import Final
from xml.etree import ElementTree

from map3d.tiles.manifest import Manifest, ManifestView
from map3d.tiles.view_plane import plane_crs
from map3d.types import Layer

SUFFIXES: Final = ("wkt", "xml", "qlr")
BANDS: Final = {"jpeg": 3}
"""Channels of a layer by its format; 4 for the others, which have transparency."""

Element = ElementTree.Element


def wkt(manifest: Manifest, view: ManifestView, height_m: float | None = None) -> str:
    """Returns the CRS for ground points at a height, by default that of the lowest content. Raises BadRequest for the height."""
    return plane_crs(manifest, view, height_m).to_wkt() + "\n"


def gdal_wms(manifest: Manifest, view: ManifestView, layer: Layer, template: str, height_m: float | None = None) -> str:
    """Returns a GDAL_WMS description. `template`: URL of a tile with `{z}`, `{x}` and `{y}`."""
    frame = view.frame
    root = Element("GDAL_WMS")
    service = _child(root, "Service", name="TMS")
    _child(service, "ServerUrl", template.replace("{", "${"))
    window = _child(root, "DataWindow")
    right, bottom = frame.u0_m + frame.size_m, frame.v0_m - frame.size_m
    for name, value in (("UpperLeftX", frame.u0_m), ("UpperLeftY", frame.v0_m), ("LowerRightX", right), ("LowerRightY", bottom)):
        _child(window, name, repr(value))
    for name, text in (("TileLevel", str(manifest.zmax)), ("TileCountX", "1"), ("TileCountY", "1"), ("YOrigin", "top")):
        _child(window, name, text)
    _child(root, "Projection", wkt(manifest, view, height_m).strip())
    for name in ("BlockSizeX", "BlockSizeY"):
        _child(root, name, str(manifest.tile_px))
    _child(root, "BandsCount", str(BANDS.get(layer.format, 4)))
    _child(root, "ZeroBlockHttpCodes", "204,404")
    _child(root, "ZeroBlockOnServerException", "true")
    return _dump(root)


def qgis_layer(manifest: Manifest, view: ManifestView, layer: Layer, template: str, height_m: float | None = None) -> str:
    """Returns a QGIS layer definition: it holds the GDAL_WMS description as its source."""
    title = f"{manifest.title or manifest.name}: view {view.frame.id}, {layer.name}"
    identity = f"map3d_{manifest.name}_{view.frame.id}_{layer.name}"
    source = gdal_wms(manifest, view, layer, template, height_m).replace("\n", "")
    root = Element("qlr")
    group = _child(root, "layer-tree-group", name="", expanded="1", checked="Qt::Checked")
    _child(group, "layer-tree-layer", id=identity, name=title, providerKey="gdal", source=source, expanded="1", checked="Qt::Checked")
    row = _child(_child(root, "maplayers"), "maplayer", type="raster")
    for name, text in (("id", identity), ("datasource", source), ("layername", title), ("provider", "gdal"), ("abstract", manifest.attribution)):
        _child(row, name, text)
    system = _child(_child(row, "srs"), "spatialrefsys")
    _child(system, "wkt", wkt(manifest, view, height_m).strip())
    return "<!DOCTYPE qgis-layer-definition>\n" + _dump(root)


def _child(parent: Element, tag: str, text: str | None = None, /, **attributes: str) -> Element:
    child = ElementTree.SubElement(parent, tag, attributes)
    child.text = text
    return child


def _dump(root: Element) -> str:
    ElementTree.indent(root)
    return ElementTree.tostring(root, "unicode") + "\n"
