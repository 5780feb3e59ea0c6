"""Files that are each broken in one way but contain usable parts."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rasterio
from PIL import Image

from tests.cli.towns import house

_CORE = "http://www.opengis.net/citygml"
_HEAD = f"""<?xml version="1.0" encoding="UTF-8"?>
{{dtd}}<core:CityModel xmlns:core="{_CORE}/2.0" xmlns:bldg="{_CORE}/building/2.0" xmlns:app="{_CORE}/appearance/2.0" xmlns:gml="http://www.opengis.net/gml">
"""
_BUILDING = """<core:cityObjectMember><bldg:Building gml:id="{name}"><bldg:lod2MultiSurface><gml:MultiSurface><gml:surfaceMember>
<gml:Polygon gml:id="p{name}"><gml:exterior><gml:LinearRing gml:id="r{name}"><gml:posList srsDimension="3">
{x} 60 0 {x2} 60 0 {x2} 60 8 {x} 60 8 {x} 60 0</gml:posList></gml:LinearRing></gml:exterior></gml:Polygon>
</gml:surfaceMember></gml:MultiSurface></bldg:lod2MultiSurface></bldg:Building></core:cityObjectMember>
"""
_BOMB = '<!DOCTYPE bomb [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]>\n'


def citygml(names: tuple[str, ...] = ("one", "two", "three"), *, dtd: str = "") -> str:
    """Returns a document with a wall of 8 m per building, in a row 60 m to the north, without a coordinate system."""
    walls = "".join(_BUILDING.format(name=name, x=20 * k, x2=20 * k + 8) for k, name in enumerate(names))
    return _HEAD.format(dtd=dtd) + walls + "</core:CityModel>\n"


def jpeg() -> bytes:
    data = io.BytesIO()
    Image.radial_gradient("L").convert("RGB").resize((64, 64)).save(data, "JPEG")
    return data.getvalue()


def png() -> bytes:
    data = io.BytesIO()
    Image.radial_gradient("L").convert("RGB").resize((64, 64)).save(data, "PNG")
    return data.getvalue()


def textured(folder: Path, name: str, x: float, image: bytes | None) -> None:
    """Writes `name`.obj: a house with the texture `name`.jpg, which is missing when `image` is None."""
    lines = house(x, 0, 8).splitlines()
    vertices = [line for line in lines if line.startswith("v")]
    faces = ["f " + " ".join(f"{v}/{k}" for k, v in enumerate(line.split()[1:], 1)) for line in lines if line.startswith("f")]
    corners = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    (folder / f"{name}.obj").write_text(f"mtllib {name}.mtl\nusemtl wall\n{corners}" + "\n".join(vertices + faces) + "\n")
    (folder / f"{name}.mtl").write_text(f"newmtl wall\nKd 0.8 0.2 0.2\nmap_Kd {name}.jpg\n")
    if image is not None:
        (folder / f"{name}.jpg").write_bytes(image)


def elevation(path: Path) -> None:
    """Writes a plain of 200 m at height −1."""
    transform = rasterio.Affine(10, 0, -60, 0, -10, 140)
    with rasterio.open(path, "w", driver="GTiff", width=20, height=20, count=1, dtype="float32", transform=transform) as raster:
        raster.write(np.full((1, 20, 20), -1, np.float32))


def house_with(extra: str, x: float = 0.0) -> Callable[[Path], object]:
    """Returns a function that writes a complete house and invalid OBJ lines."""
    return lambda path: path.write_text(house(x, 0, 8) + extra)


BAD_LINES = {
    "big": "f 1 2 99\n",
    "nought": "f 0 1 2\n",
    "before": "f -1 -2 -99\n",
    "nan": "v nan 0 0\nv 1 -inf 1\nf 1 2 9\nf 1 2 10\n",
}
"""Lines that invalidate only their own faces."""

DAMAGED_IMAGES: dict[str, bytes | None] = {
    "missing": None,
    "zero": b"",
    "cut": jpeg()[: len(jpeg()) // 2],
    "lying": png(),
    "text": b"no image at all",
}
"""The bytes of a file named as JPEG. `lying` is a valid image in another format."""

USELESS_FILES: dict[str, bytes] = {
    "empty.obj": b"",
    "empty.gml": b"",
    "empty.tif": b"",
    "words.gml": b"these are words\n",
    "cut.tif": b"II*\0\x08\0\0\0",
    "nothing.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 7 8 9\n",
    "bomb.gml": citygml(("&c;",), dtd=_BOMB).encode(),
}
"""Files without any usable part."""


def truncated() -> str:
    """Returns a document whose third building is cut off."""
    text = citygml()
    return text[: text.index('gml:id="three"') + 200]
