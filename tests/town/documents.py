"""Reads the CityGML files of the generator with ElementTree."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from map3d_town import TownSpec

Points = NDArray[np.float64]
GML = "{http://www.opengis.net/gml}"
APP = "{http://www.opengis.net/citygml/appearance/2.0}"
BLDG = "{http://www.opengis.net/citygml/building/2.0}"
CORE = "{http://www.opengis.net/citygml/2.0}"
XLINK = "{http://www.w3.org/1999/xlink}href"

TOWN = TownSpec(buildings=14, seed=4, files=2, texture_px=256, formats=("citygml", "obj"), ortho_m=1.0, dem_m=4.0, deep_share=0.5)
ROMAN = TownSpec(style="roman", buildings=110, seed=2, texture_px=512, buildings_per_texture=8, terrain=False)


def parse_files(folder: Path, pattern: str = "*.gml") -> list[ET.Element]:
    found = [ET.parse(path).getroot() for path in sorted((folder / "citygml").glob(pattern))]
    assert found, f"no {pattern} in {folder}"
    return found


def numbers(text: str | None, columns: int) -> Points:
    assert text
    return np.array(text.split(), dtype=float).reshape(-1, columns)


def rings_of(polygon: ET.Element) -> dict[str, Points]:
    """Returns rings (n, 3) by id, with the repeated last point."""
    return {ring.attrib[GML + "id"]: numbers(ring.findtext(GML + "posList"), 3) for ring in polygon.iter(GML + "LinearRing")}


def rings_by_polygon(root: ET.Element) -> dict[str, dict[str, Points]]:
    return {p.attrib[GML + "id"]: rings_of(p) for p in root.iter(GML + "Polygon")}


def solids(root: ET.Element) -> Iterator[tuple[str, list[list[Points]]]]:
    """Yields (id of the last polygon, polygons of the shell as lists of rings) for each solid; follows links."""
    every = rings_by_polygon(root)
    for solid in root.iter(GML + "Solid"):
        shell = []
        for member in solid.iter(GML + "surfaceMember"):
            inner = member.find(GML + "Polygon")
            name = member.attrib[XLINK][1:] if inner is None else inner.attrib[GML + "id"]
            shell.append(list(every[name].values()))
        yield str(name), shell


def textures(root: ET.Element) -> Iterator[tuple[str, str, dict[str, Points]]]:
    """Yields (image, wrap mode, texture coordinates by ring id)."""
    for texture in root.iter(APP + "ParameterizedTexture"):
        uri, mode = texture.findtext(APP + "imageURI"), texture.findtext(APP + "wrapMode")
        assert uri
        assert mode
        yield uri, mode, {c.attrib["ring"][1:]: numbers(c.text, 2) for c in texture.iter(APP + "textureCoordinates")}


def normal(ring: Points) -> Points:
    """Returns Newell's normal; its length is twice the area."""
    centred = ring[:-1] - ring[:-1].mean(axis=0)
    return np.asarray(np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0))
