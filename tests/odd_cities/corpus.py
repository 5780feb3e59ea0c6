"""A folder with every oddity at once: files that are read right and said, files that are refused with a reason, and what belongs to none."""

import math
from pathlib import Path

from PIL import Image

from tests.cli.towns import house
from tests.ingest.terrain.rasters import colours, hills
from tests.odd_cities import strays
from tests.odd_cities.test_tiled_rasters import write_tiles
from tests.odd_cities.towns import HEAD, MUNICH, at, write_citygml

UTM = "EPSG:25832"
EAST, NORTH = 691_600.0, 5_334_700.0
"""A corner in the middle of Munich."""


def write_corpus(folder: Path) -> Path:
    """Writes the files of a city around Munich, one or two for each oddity."""
    strays.polygon_at_0_0_0(folder / "stray")
    write_citygml(folder / "other-zone.gml", UTM, at(*MUNICH, "EPSG:25833"), side=1, prefix="zone-")
    write_citygml(folder / "swapped.gml", "EPSG:4326", at(MUNICH[0] + 0.004, MUNICH[1], "EPSG:4326"), side=3, prefix="swapped-")
    write_citygml(folder / "gauss-krueger.gml", "EPSG:31468", at(*MUNICH, "EPSG:4326"), side=1, prefix="gk-")
    write_citygml(folder / "no-label.gml", None, at(*MUNICH, UTM), side=1, prefix="none-")
    _cut(write_citygml(folder / "cut.gml", UTM, at(MUNICH[0], MUNICH[1] + 0.004, UTM), prefix="cut-"))
    _textures_beside_and_above(folder / "models", folder / "textures")
    (folder / "spiral.obj").write_text(_spiral(2_000))
    (folder / "latin-1.gml").write_bytes(_latin_1())
    (folder / "two-lods.gml").write_text(_two_lods())
    write_tiles(folder / "dem", "dem", hills(40, 40), 20)
    (folder / "dem" / "dem-20-20.tif").unlink()
    write_tiles(folder / "dem", "photo", colours(80, 80), 40, 0.5)
    (folder / "town.json").write_text('{"type": "CityJSON", "version": "2.0"}')
    (folder / "points.las").write_bytes(b"LASF" + bytes(100))
    with (folder / "sparse.gml").open("wb") as sparse:
        sparse.truncate(50 << 30)
    return folder


def _cut(path: Path) -> None:
    text = path.read_bytes()
    path.write_bytes(text[: len(text) * 3 // 4])


def _textures_beside_and_above(models: Path, textures: Path) -> None:
    models.mkdir()
    textures.mkdir()
    Image.new("RGB", (8, 8), (200, 30, 30)).save(textures / "wall.png")
    (models / "shop.mtl").write_text("newmtl wall\nmap_Kd ../textures/wall.png\nnewmtl roof\nmap_Kd ../textures/lost.png\n")
    lines = house(EAST, NORTH, 9.0).splitlines()
    faces = [" ".join(["f", *(f"{word}/{k}" for k, word in enumerate(line.split()[1:], 1))]) for line in lines[8:]]
    (models / "shop.obj").write_text(
        "\n".join(["mtllib shop.mtl", *lines[:8], "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "usemtl wall", *faces[:3], "usemtl roof", *faces[3:]])
        + "\n"
    )


def _spiral(count: int) -> str:
    """Returns one polygon: a band wound up ten times."""
    turns = [20.0 * math.pi * k / count for k in range(count)]
    out = [(a * 0.5 * math.cos(a), a * 0.5 * math.sin(a)) for a in turns]
    back = [((a + 1.0) * 0.5 * math.cos(a), (a + 1.0) * 0.5 * math.sin(a)) for a in reversed(turns)]
    vertices = "".join(f"v {EAST + 200 + x:.4f} {NORTH + y:.4f} 5\n" for x, y in [*out, *back])
    return vertices + "f " + " ".join(str(k + 1) for k in range(2 * count)) + "\n"


def _ring(height: float, x: float) -> str:
    corners = [(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)]
    numbers = " ".join(f"{EAST + x + a} {NORTH + 100 + b} {500 + height}" for a, b in corners)
    ring = f'<gml:LinearRing><gml:posList srsDimension="3">{numbers}</gml:posList></gml:LinearRing>'
    polygon = f"<gml:Polygon><gml:exterior>{ring}</gml:exterior></gml:Polygon>"
    return f'<gml:MultiSurface srsName="{UTM}" srsDimension="3"><gml:surfaceMember>{polygon}</gml:surfaceMember></gml:MultiSurface>'


def _building(name: str, content: str) -> str:
    return f'<core:cityObjectMember><bldg:Building gml:id="{name}">{content}</bldg:Building></core:cityObjectMember>\n'


def _two_lods() -> str:
    """Returns a house of two levels of detail, with an attribute of an unknown extension."""
    lods = "".join(f"<bldg:lod{lod}MultiSurface>{_ring(3.0 * lod, 0.0)}</bldg:lod{lod}MultiSurface>" for lod in (1, 2))
    extension = '<uro:floors xmlns:uro="https://www.geospatial.jp/iur/uro/2.0">4</uro:floors>'
    return HEAD + _building("two-lods", extension + lods) + "</core:CityModel>\n"


def _latin_1() -> bytes:
    """Returns a document whose letters are not those of the encoding that it declares."""
    name = "<gml:name>Südhaus</gml:name>"
    lod = f"<bldg:lod1MultiSurface>{_ring(3.0, 40.0)}</bldg:lod1MultiSurface>"
    return (HEAD + _building("latin-1", name + lod) + "</core:CityModel>\n").encode("latin-1")
