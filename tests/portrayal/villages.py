"""Two small built scenes: `village` from CityGML with two levels of detail, and `harbour` from OBJ in a system with northings first."""

from pathlib import Path

from map3d.catalogue import Workspace
from map3d.cli import app
from tests.cli.towns import house
from tests.object_servers import environment

EAST, NORTH = 691000.0, 5336000.0
CITY = """<?xml version="1.0" encoding="UTF-8"?>
<CityModel xmlns="http://www.opengis.net/citygml/2.0" xmlns:gml="http://www.opengis.net/gml" xmlns:bldg="http://www.opengis.net/citygml/building/2.0"
 xmlns:gen="http://www.opengis.net/citygml/generics/2.0">
<gml:boundedBy><gml:Envelope srsName="urn:ogc:def:crs,crs:EPSG::25832,crs:EPSG::7837" srsDimension="3">
<gml:lowerCorner>690000 5335000 0</gml:lowerCorner>
<gml:upperCorner>692000 5337000 100</gml:upperCorner></gml:Envelope></gml:boundedBy>
{members}</CityModel>
"""
BUILDING = """<cityObjectMember><bldg:Building gml:id="{name}"><gml:name>{name} &amp; Sons</gml:name>
<gen:stringAttribute name="owner"><gen:value>&lt;b&gt;Å&lt;/b&gt;</gen:value></gen:stringAttribute>
<bldg:function>{function}</bldg:function><bldg:lod{lod}MultiSurface><gml:MultiSurface>{surfaces}</gml:MultiSurface></bldg:lod{lod}MultiSurface>
</bldg:Building></cityObjectMember>
"""
SURFACE = (
    "<gml:surfaceMember><gml:Polygon><gml:exterior><gml:LinearRing><gml:posList>{}</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>"
    "</gml:surfaceMember>"
)


def building(name: str, lod: int, x: float, y: float, height: float) -> str:
    """Returns a building of 20 × 20 m whose south-western corner is (x, y) metres from (EAST, NORTH)."""
    x0, y0, x1, y1 = EAST + x, NORTH + y, EAST + x + 20, NORTH + y + 20
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    rings = [[(*corner, height) for corner in corners], [(*corner, 0.0) for corner in reversed(corners)]]
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        rings.append([(*a, 0.0), (*b, 0.0), (*b, height), (*a, height)])
    surfaces = "".join(SURFACE.format(" ".join(f"{c:.3f}" for point in [*ring, ring[0]] for c in point)) for ring in rings)
    return BUILDING.format(name=name, lod=lod, function="1000", surfaces=surfaces)


def make_villages(root: Path) -> Workspace:
    """Creates a workspace with both scenes built and a complete rendering of `village`."""
    files = root / "files"
    files.mkdir(parents=True)
    (files / "low.gml").write_text(CITY.format(members=building("low-a", 1, 0, 0, 10) + building("low-b", 1, 100, 0, 12)), encoding="utf-8")
    (files / "high.gml").write_text(CITY.format(members=building("high-a", 2, 0, 100, 30)), encoding="utf-8")
    (files / "boxes.obj").write_text(house(3500010.0, 5400020.0, 8.0) + "\n")
    workspace = root / "ws"
    with environment({"MAP3D_WORKSPACE": str(workspace)}):
        for words in (
            ["create-scene", "village", "--title", "Village & <Church>"],
            ["add-files", "village", str(files / "low.gml"), str(files / "high.gml")],
            ["create-rendering", "village", "village", "--view", "0-45", "--res", "0.25"],
            ["render", "village"],
            ["create-scene", "harbour", "--crs", "EPSG:31467"],
            ["add-files", "harbour", str(files / "boxes.obj"), "--up", "z"],
            ["create-rendering", "harbour", "harbour", "--view", "0-45", "--res", "0.5"],
            ["estimate", "harbour"],
            ["render", "harbour"],
        ):
            assert app.run(words) == 0, words
    return Workspace(workspace)
